"""The planner's results, paths and labels, and a driver that follows a path to the ball."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth.config import PlannerConfig
from steerlab.sim.ground_truth.stanley import stanley_rad, steering_of
from steerlab.sim.vehicle import CarConfig


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A path of the car's rear axle, ending at the ball's centre.

    Attributes:
        points: (n, 2) x_m, y_m in the world, n >= 2.
        heading: (n,) direction of travel in radians, without jumps of 2 pi.
    """

    points: FloatArray
    heading: FloatArray

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 2 or len(self.points) < 2:
            raise InvalidConfig(f"Path points are {self.points.shape}, not (n >= 2, 2).")
        if self.heading.shape != (len(self.points),):
            raise InvalidConfig(f"Path heading is {self.heading.shape}, not {(len(self.points),)}.")
        if not (np.isfinite(self.points).all() and np.isfinite(self.heading).all()):
            raise InvalidConfig("A path holds NaN or infinity.")

    @property
    def arc_m(self) -> FloatArray:
        """(n,) length along the path from its first point."""
        steps_m = np.hypot(*np.diff(self.points, axis=0).T)
        return np.concatenate(([0.0], np.cumsum(steps_m)))

    @property
    def length_m(self) -> float:
        """Length from the rear axle's first point to the ball."""
        return float(self.arc_m[-1])


@dataclass(frozen=True, slots=True, eq=False)
class OracleLabels:
    """Ground truth of one rollout.

    Attributes:
        wheel: (steps,) label ``o`` in [-2.5, 2.5]; NaN where not valid.
        valid: (steps,) False where no path exists.
        reason: why not, one entry a step; None where valid.
    """

    wheel: FloatArray
    valid: NDArray[np.bool_]
    reason: tuple[str | None, ...]

    def __post_init__(self) -> None:
        if not self.wheel.shape == self.valid.shape == (len(self.reason),):
            raise InvalidConfig(
                f"wheel {self.wheel.shape}, valid {self.valid.shape} and {len(self.reason)} "
                "reasons are not of one rollout."
            )
        if (np.isnan(self.wheel) == self.valid).any():
            raise InvalidConfig("A step is valid exactly where its label is a number.")


class OracleDriver:
    """Stanley along one path, never going back, so that crossings do not mislead it."""

    def __init__(self, path: Path, car: CarConfig, config: PlannerConfig) -> None:
        self.path = path
        self._car = car
        self._points = np.ascontiguousarray(path.points, dtype=np.float64)
        self._heading = np.ascontiguousarray(path.heading, dtype=np.float64)
        self._steering = steering_of(car, config)
        self._segment = 0

    @property
    def segment(self) -> int:
        """The path segment the front axle has reached; never decreases."""
        return self._segment

    def wheel(self, pose: Pose2D, speed_mps: float) -> float:
        """Wheel position in [-2.5, 2.5] for the car's centre at ``pose``."""
        rear = pose.ahead(-self._car.wheelbase_m / 2.0)
        delta_rad, self._segment = stanley_rad(
            self._points,
            self._heading,
            self._segment,
            rear.x_m,
            rear.y_m,
            rear.heading_rad,
            float(speed_mps),
            self._steering,
        )
        return self._car.wheel(delta_rad)
