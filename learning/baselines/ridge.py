"""A linear window: ridge regression of the difference on the labels within ±1 s."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.series import LabelSeries, by_person, lookup_person
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

PENALTIES: FloatArray = 10.0 ** np.arange(-2.0, 5.1, 0.5)
"""Tried on the training people; squared wheel units, summed over windows."""


@dataclass(frozen=True, slots=True, eq=False)
class RidgeSums:
    """Sums over windows that a ridge regression needs, one set a rollout.

    Attributes:
        gram: (rollouts, features, features).
        product: (rollouts, features), features times difference.
        square: (rollouts,), squared difference.
    """

    gram: FloatArray
    product: FloatArray
    square: FloatArray

    def coefficients(self, penalties: FloatArray) -> FloatArray:
        """(penalties, features) over all rollouts; the intercept, last, is not penalised."""
        return _solve(self.gram.sum(axis=0), self.product.sum(axis=0), penalties)

    def left_out_error(self, penalties: FloatArray) -> FloatArray:
        """Squared error on each rollout when fitted on the others, summed, (penalties,)."""
        gram, product = self.gram.sum(axis=0), self.product.sum(axis=0)
        error = np.zeros(len(penalties))
        for own_gram, own_product, square in zip(self.gram, self.product, self.square, strict=True):
            beta = _solve(gram - own_gram, product - own_product, penalties)
            quadratic = np.einsum("pf,fg,pg->p", beta, own_gram, beta)
            error += square - 2.0 * beta @ own_product + quadratic
        return error


class SharedRidgeMapper:
    """One linear window for everybody; its penalty by leave-one-rollout-out on the training people.

    Args:
        window: what is regressed on.
        penalties: those tried.
    """

    name = "shared_ridge"

    def __init__(
        self, window: WindowConfig | None = None, penalties: FloatArray = PENALTIES
    ) -> None:
        self._window = window or WindowConfig()
        self._penalties = penalties
        self._coefficients: FloatArray | None = None

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Choose the penalty, then fit everyone's windows at once.

        Raises:
            InvalidLabels: no valid step, or only one rollout to choose the penalty with.
        """
        everyone = ridge_sums(series, self._window)
        penalty = choose_penalty([everyone], self._penalties)
        self._coefficients = everyone.coefficients(np.array([penalty]))[0]

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone has the same window."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: ``fit`` was not called.
        """
        if self._coefficients is None:
            raise NotFitted(f"{self.name} has no coefficients; call fit.")
        return _map(series, self._window, self._coefficients)


class PersonRidgeMapper:
    """A linear window per person; one penalty for all, chosen on the training people.

    Args:
        window: what is regressed on.
        penalties: those tried.
    """

    name = "person_ridge"

    def __init__(
        self, window: WindowConfig | None = None, penalties: FloatArray = PENALTIES
    ) -> None:
        self._window = window or WindowConfig()
        self._penalties = penalties
        self._penalty: float | None = None
        self._coefficients: dict[str, FloatArray] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Forget everyone, choose the penalty by leave-one-rollout-out, then fit each person.

        Raises:
            InvalidLabels: someone without a valid step, or nobody with two rollouts.
        """
        people = {
            person: ridge_sums(drives, self._window) for person, drives in by_person(series).items()
        }
        self._penalty = choose_penalty(list(people.values()), self._penalties)
        self._coefficients = {
            person: sums.coefficients(np.array([self._penalty]))[0]
            for person, sums in people.items()
        }

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the people in ``series`` with the penalty chosen on the training people.

        Raises:
            NotFitted: ``fit`` was not called.
            InvalidLabels: someone without a valid step.
        """
        if self._penalty is None:
            raise NotFitted(f"{self.name} has no penalty yet; call fit.")
        for person, drives in by_person(series).items():
            fitted = ridge_sums(drives, self._window).coefficients(np.array([self._penalty]))
            self._coefficients[person] = fitted[0]

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        coefficients = lookup_person(self._coefficients, self.name, series.person)
        return _map(series, self._window, coefficients)


def ridge_sums(series: Sequence[LabelSeries], window: WindowConfig) -> RidgeSums:
    """Sums over the valid windows of ``series``, series of one rollout together.

    Raises:
        InvalidLabels: no valid step.
    """
    rollouts: dict[str, list[LabelSeries]] = {}
    for drive in series:
        if drive.valid.any():
            rollouts.setdefault(drive.rollout, []).append(drive)
    if not rollouts:
        subject = repr(series[0].person) if series else "No one"
        raise InvalidLabels(f"{subject} has no valid label to fit a window to; label a rollout.")
    gram, product, square = [], [], []
    for drives in rollouts.values():
        valid = np.concatenate([drive.valid for drive in drives])
        x = np.concatenate([features(drive, window) for drive in drives])[valid]
        difference = np.concatenate([drive.label - drive.truth for drive in drives])[valid]
        gram.append(x.T @ x)
        product.append(x.T @ difference)
        square.append(float(difference @ difference))
    return RidgeSums(np.stack(gram), np.stack(product), np.array(square))


def choose_penalty(people: Sequence[RidgeSums], penalties: FloatArray) -> float:
    """The penalty with the least squared error on left-out rollouts, over all of ``people``.

    Raises:
        InvalidLabels: nobody has two rollouts.
    """
    choosing = [sums for sums in people if len(sums.square) > 1]
    if not choosing:
        raise InvalidLabels(
            "Nobody has two rollouts; leaving one out needs two to choose a ridge penalty."
        )
    error = np.sum([sums.left_out_error(penalties) for sums in choosing], axis=0)
    return float(penalties[np.argmin(error)])


def features(series: LabelSeries, window: WindowConfig) -> FloatArray:
    """Labels of each window, where one is absent, and 1: (steps, 2 * length + 1)."""
    inputs = make_windows([series], window).inputs.numpy().astype(np.float64)
    label, present = inputs[:, :, 0], inputs[:, :, 1]
    return np.concatenate([label, 1.0 - present, np.ones((len(inputs), 1))], axis=1)


def _solve(gram: FloatArray, product: FloatArray, penalties: FloatArray) -> FloatArray:
    diagonal = np.ones(len(product))
    diagonal[-1] = 0.0
    system = gram + penalties[:, None, None] * np.diag(diagonal)
    right = np.broadcast_to(product[:, None], (len(penalties), len(product), 1))
    return np.asarray(np.linalg.solve(system, right)[:, :, 0], dtype=np.float64)


def _map(series: LabelSeries, window: WindowConfig, coefficients: FloatArray) -> FloatArray:
    difference = features(series, window) @ coefficients
    return np.clip(series.label - difference, -WHEEL_LIMIT, WHEEL_LIMIT)
