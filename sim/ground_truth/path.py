"""``Path``: where the rear axle should go, as points with headings."""

from dataclasses import dataclass

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig


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
        """From the rear axle's first point to the ball."""
        return float(self.arc_m[-1])
