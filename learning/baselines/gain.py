"""Labels as given, times a gain, or times a gain and read later: what an engineer tries first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.series import LabelSeries, by_person, lookup_person
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
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
            person: _factor(drives, repr(person)) for person, drives in by_person(series).items()
        }

    def map(self, series: LabelSeries) -> FloatArray:
        """Labels times the person's factor, (steps,), clamped.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        factor = lookup_person(self._factor, self.name, series.person)
        return np.clip(factor * series.label, -WHEEL_LIMIT, WHEEL_LIMIT)


def _factor(series: Sequence[LabelSeries], subject: str) -> float:
    product, square = 0.0, 0.0
    for drive in series:
        label, truth = drive.label[drive.valid], drive.truth[drive.valid]
        product, square = product + float(label @ truth), square + float(label @ label)
    if square == 0.0:
        raise InvalidLabels(f"{subject} have no valid label other than 0; no gain fits.")
    return product / square


@dataclass(frozen=True, kw_only=True)
class DelayGrid:
    """The delays tried, in seconds; a negative one belongs to a person who anticipates."""

    low_s: float = -0.8
    high_s: float = 1.2
    step_s: float = 0.02

    def __post_init__(self) -> None:
        if not (self.step_s > 0.0 and self.low_s < self.high_s):
            raise InvalidConfig(f"{self} holds no delay; give low_s below high_s, step_s above 0.")

    def delays_s(self) -> FloatArray:
        """(delays,), ascending."""
        count = round((self.high_s - self.low_s) / self.step_s) + 1
        return np.array([self.low_s + index * self.step_s for index in range(count)])


@dataclass(frozen=True, kw_only=True)
class GainAndDelay:
    """``mapped(t) = factor * label(t + delay_s)``; pure delay and neuromuscular lag are one."""

    factor: float
    delay_s: float


class PersonGainLagMapper:
    """A factor and a fractional delay per person: a grid of delays, least squares at each.

    Labels are read between steps. Where the delayed moment lies beyond the rollout, the last
    label there is stands for it; a moment without a label is bridged from its neighbours.
    """

    name = "person_gain_lag"

    def __init__(self, grid: DelayGrid | None = None) -> None:
        self._delays_s = (grid or DelayGrid()).delays_s()
        self._learned: dict[str, GainAndDelay] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Forget everyone, then fit the people in ``series``.

        Raises:
            InvalidLabels: someone gave no label other than 0.
        """
        self._learned = {}
        self.calibrate(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the people in ``series``.

        Raises:
            InvalidLabels: someone gave no label other than 0.
        """
        self._learned |= {person: self._fit(drives) for person, drives in by_person(series).items()}

    def map(self, series: LabelSeries) -> FloatArray:
        """Labels times the factor, read ``delay_s`` later, (steps,), clamped.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        learned = self.learned(series.person)
        mapped = learned.factor * read_later(series, learned.delay_s)
        return np.where(
            np.isfinite(series.label), np.clip(mapped, -WHEEL_LIMIT, WHEEL_LIMIT), np.nan
        )

    def learned(self, person: str) -> GainAndDelay:
        """What was fitted for the person.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return lookup_person(self._learned, self.name, person)

    def _fit(self, series: Sequence[LabelSeries]) -> GainAndDelay:
        product, square = np.zeros(len(self._delays_s)), np.zeros(len(self._delays_s))
        for drive in series:
            if not drive.valid.any():
                continue
            later = np.stack([read_later(drive, delay) for delay in self._delays_s])[:, drive.valid]
            product += later @ drive.truth[drive.valid]
            square += np.square(later).sum(axis=1)
        if not (square > 0.0).all():
            raise InvalidLabels(
                f"{series[0].person!r} has no valid label other than 0; no gain fits."
            )
        best = int(np.argmax(np.square(product) / square))  # least squared error
        return GainAndDelay(
            factor=float(product[best] / square[best]), delay_s=float(self._delays_s[best])
        )


def read_later(series: LabelSeries, delay_s: float) -> FloatArray:
    """``label(t + delay_s)`` at each step, (steps,), linear between labels; NaN without any."""
    given = np.isfinite(series.label)
    if not given.any():
        return np.full(series.steps, np.nan)
    steps = np.arange(series.steps, dtype=np.float64)
    return np.interp(steps + delay_s * series.rate_hz, steps[given], series.label[given])
