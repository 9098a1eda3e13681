"""``EmpiricalBayesMapper``: a linear model a person, its prior learned from the training people."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.empirical_bayes.gaussian import Moments, Prior, fit_prior, posterior
from steerlab.learning.empirical_bayes.grid import (
    GridSeries,
    from_grid,
    label_features,
    whole_window,
)
from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.series import LabelSeries, lookup_person
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class EmpiricalBayesMapper:
    """Truth as a linear function of the labels within ±1 s and a few non-linear features.

    No simulation and no network: the prior comes from the training people by EM, a person's
    coefficients from their calibration labels in closed form. It beats the per-person ridge,
    which is the same with a fixed prior around 0.
    """

    name = "eb_nonlinear"

    def __init__(self, *, temper: float = 0.1) -> None:
        self._temper = temper
        self._prior: Prior | None = None
        self._coefficients: dict[str, FloatArray] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Learn the prior; forgets whatever was fitted or calibrated before.

        Raises:
            InvalidLabels: fewer than two people, or someone without a usable label.
        """
        people, moments = inverse_moments(series)
        self._prior = fit_prior(moments, temper=self._temper)
        self._coefficients = dict(zip(people, posterior(moments, self._prior).mean, strict=True))

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """The coefficients of the people in ``series``; someone known gets new ones.

        Raises:
            NotFitted: ``fit`` was not called.
            InvalidLabels: no series, or someone without a usable label.
        """
        if self._prior is None:
            raise NotFitted(f"{self.name} has no prior; call fit with the training people first.")
        people, moments = inverse_moments(series)
        means = posterior(moments, self._prior).mean
        self._coefficients |= dict(zip(people, means, strict=True))

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        coefficients = lookup_person(self._coefficients, self.name, series.person)
        grid = GridSeries.from_series(series)
        mapped = label_features(grid.label) @ coefficients
        at_steps = np.clip(from_grid(mapped, series), -WHEEL_LIMIT, WHEEL_LIMIT)
        return np.where(np.isfinite(series.label), at_steps, np.nan)


def inverse_moments(series: Sequence[LabelSeries]) -> tuple[tuple[str, ...], Moments]:
    """People in order of appearance, and the moments of truth on label features of each.

    Samples whose window is not whole do not count, unless someone has no other.

    Raises:
        InvalidLabels: no series, or someone without a valid label.
    """
    people: dict[str, Moments] = {}
    for drive in series:
        grid = GridSeries.from_series(drive)
        rows = grid.valid & whole_window(grid.present)
        if not rows.any():
            rows = grid.valid
        sums = Moments.of(label_features(grid.label)[rows], grid.truth[rows])
        people[drive.person] = people[drive.person] + sums if drive.person in people else sums
    if not people:
        raise InvalidLabels("No label series given; calibration needs at least one.")
    for person, sums in people.items():
        if not sums.rows.any():
            raise InvalidLabels(f"{person!r} has no valid label to calibrate on; label a rollout.")
    return tuple(people), Moments.concatenate(list(people.values()))
