"""What MIND MELD must beat before anything is claimed for it."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.series import LabelSeries
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class IdentityMapper:
    """Labels as given."""

    name = "identity"

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn."""

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn."""

    def map(self, series: LabelSeries) -> FloatArray:
        """The labels themselves, (steps,)."""
        return np.clip(series.label, -WHEEL_LIMIT, WHEEL_LIMIT)


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
        sums: dict[str, tuple[float, float]] = {}
        for one in series:
            label, truth = one.label[one.valid], one.truth[one.valid]
            product, square = sums.get(one.person, (0.0, 0.0))
            sums[one.person] = (product + float(label @ truth), square + float(label @ label))
        for person, (product, square) in sums.items():
            if square == 0.0:
                raise InvalidLabels(f"{person!r} has no valid label other than 0; no gain fits.")
            self._factor[person] = product / square

    def map(self, series: LabelSeries) -> FloatArray:
        """Labels times the person's factor, (steps,), clamped.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        if series.person not in self._factor:
            raise UnknownPerson(
                f"{self.name} does not know {series.person!r}; call calibrate with their series."
            )
        return np.clip(self._factor[series.person] * series.label, -WHEEL_LIMIT, WHEEL_LIMIT)


class MeanEmbeddingMapper:
    """MIND MELD's network with everyone's w replaced by the training people's mean.

    Shares the network it is given: a fitted one needs no second ``fit``.
    """

    name = "mean_embedding"

    def __init__(self, mind_meld: MindMeldMapper) -> None:
        self._mind_meld = mind_meld

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the shared network."""
        self._mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone is the mean."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: the shared network is not trained.
        """
        return self._mind_meld.map_with(self._mind_meld.mean_embedding, series)
