"""One factor on the label, for everybody or for each person."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.people import by_person, of_person
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class SharedGainMapper:
    """One factor for everybody: least squares of truth on label, through the origin."""

    name = "shared_gain"

    def __init__(self) -> None:
        self._factor: float | None = None

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Fit the factor on everyone's labels.

        Raises:
            InvalidLabels: no one gave a label other than 0.
        """
        self._factor = _factor(series, "The training people")

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone has the same factor."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Labels times the factor, (steps,), clamped.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        if self._factor is None:
            raise NotFitted(f"{self.name} has no factor; call fit.")
        return np.clip(self._factor * series.label, -WHEEL_LIMIT, WHEEL_LIMIT)


class PersonGainMapper:
    """One factor per person: least squares of truth on label, through the origin."""

    name = "person_gain"

    def __init__(self) -> None:
        self._factor: dict[str, float] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Forget everyone, then fit the people in ``series``.

        Raises:
            InvalidLabels: someone gave no label other than 0.
        """
        self._factor = {}
        self.calibrate(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the people in ``series``.

        Raises:
            InvalidLabels: someone gave no label other than 0.
        """
        self._factor |= {
            person: _factor(own, repr(person)) for person, own in by_person(series).items()
        }

    def map(self, series: LabelSeries) -> FloatArray:
        """Labels times the person's factor, (steps,), clamped.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        factor = of_person(self._factor, self.name, series.person)
        return np.clip(factor * series.label, -WHEEL_LIMIT, WHEEL_LIMIT)


def _factor(series: Sequence[LabelSeries], whose: str) -> float:
    product, square = 0.0, 0.0
    for one in series:
        label, truth = one.label[one.valid], one.truth[one.valid]
        product, square = product + float(label @ truth), square + float(label @ label)
    if square == 0.0:
        raise InvalidLabels(f"{whose} have no valid label other than 0; no gain fits.")
    return product / square
