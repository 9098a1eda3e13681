"""What the car's motion alone says of the truth: no label is read, and nobody in particular."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.baselines.ridge import PENALTIES, RidgeSums, choose_penalty
from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.series import LabelSeries
from steerlab.learning.windows import WindowConfig, window_offsets
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

MOTION = ("yaw_rate_radps", "robot_wheel")


class NoLabelsMapper:
    """A ridge regression of the truth on yaw rate and robot's wheel within a window.

    A robot that steers by the truth plus errors gives part of the truth away. What a mapper with
    context gains over this comes from the labels; what this removes does not.

    Args:
        window: what is regressed on.
    """

    name = "no_labels"

    def __init__(self, window: WindowConfig | None = None) -> None:
        self._window = window or WindowConfig()
        self._coefficients: FloatArray | None = None

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Choose the penalty by leaving rollouts out, then fit all.

        Raises:
            InvalidLabels: no valid step, only one rollout, or the car's motion is missing.
        """
        rollouts: dict[str, list[LabelSeries]] = {}
        for drive in series:
            if drive.valid.any():
                rollouts.setdefault(drive.rollout, []).append(drive)
        if not rollouts:
            raise InvalidLabels(f"No series has a valid step to fit {self.name} to.")
        gram, product, square = [], [], []
        for drives in rollouts.values():
            x = np.concatenate([motion_features(one, self._window)[one.valid] for one in drives])
            truth = np.concatenate([one.truth[one.valid] for one in drives])
            gram.append(x.T @ x)
            product.append(x.T @ truth)
            square.append(float(truth @ truth))
        sums = RidgeSums(np.stack(gram), np.stack(product), np.array(square))
        penalty = choose_penalty([sums], PENALTIES)
        self._coefficients = sums.coefficients(np.array([penalty]))[0]

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn of a person whose labels are not read."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Truth as the motion has it, (steps,); NaN where there was no label.

        Raises:
            NotFitted: ``fit`` was not called.
            InvalidLabels: the car's motion is missing.
        """
        if self._coefficients is None:
            raise NotFitted(f"{self.name} has no coefficients; call fit.")
        truth = motion_features(series, self._window) @ self._coefficients
        mapped = np.clip(truth, -WHEEL_LIMIT, WHEEL_LIMIT)
        return np.where(np.isfinite(series.label), mapped, np.nan)


def motion_features(series: LabelSeries, window: WindowConfig) -> FloatArray:
    """Yaw rate and robot's wheel at the window's samples, held at the ends, and 1.

    Shape (steps, 2 * length + 1).

    Raises:
        InvalidLabels: the series carries no such motion.
    """
    if missing := [name for name in MOTION if name not in series.context_names]:
        raise InvalidLabels(
            f"Series of {series.person!r} on {series.rollout!r} has no {', '.join(missing)}, "
            "which no_labels reads; record the car's motion, or leave no_labels out."
        )
    below, fraction = window_offsets(series.rate_hz, window)
    at = np.arange(series.steps)[:, None] + below + fraction
    steps = np.arange(series.steps, dtype=np.float64)
    columns = [series.context[:, series.context_names.index(name)] for name in MOTION]
    read = [np.interp(at, steps, column) for column in columns]
    return np.concatenate([*read, np.ones((series.steps, 1))], axis=1)
