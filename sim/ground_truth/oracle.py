"""``OracleDriver``: drives a committed path to the ball, in MuJoCo or anywhere else."""

import numpy as np

from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth.config import PlannerConfig
from steerlab.sim.ground_truth.path import Path
from steerlab.sim.ground_truth.stanley import stanley_rad, steering_of
from steerlab.sim.vehicle import CarConfig


class OracleDriver:
    """Stanley along one path, never looking back: where paths cross it stays on its own part."""

    def __init__(self, path: Path, car: CarConfig, config: PlannerConfig) -> None:
        self.path = path
        self._car = car
        self._points = np.ascontiguousarray(path.points, dtype=np.float64)
        self._heading = np.ascontiguousarray(path.heading, dtype=np.float64)
        self._steering = steering_of(car, config)
        self._segment = 0

    @property
    def segment(self) -> int:
        """The path segment the front axle has got to; never falls."""
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
