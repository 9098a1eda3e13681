"""Poses and angles in the plane: pure functions on metres and radians."""

from dataclasses import dataclass
from math import atan2, cos, isfinite, pi, sin

from steerlab.sim.errors import InvalidConfig


@dataclass(frozen=True, slots=True)
class Pose2D:
    """Where the car is: its centre (midway between the axles) and heading, in the world frame.

    Heading 0 points along +x, and grows counter-clockwise; it need not be wrapped.
    """

    x_m: float
    y_m: float
    heading_rad: float

    def __post_init__(self) -> None:
        if not (isfinite(self.x_m) and isfinite(self.y_m) and isfinite(self.heading_rad)):
            raise InvalidConfig(f"{self} is not finite; give metres and radians.")

    def ahead(self, distance_m: float) -> "Pose2D":
        """The pose ``distance_m`` further along the heading (negative: behind)."""
        return Pose2D(
            self.x_m + distance_m * cos(self.heading_rad),
            self.y_m + distance_m * sin(self.heading_rad),
            self.heading_rad,
        )


def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + pi) % (2.0 * pi) - pi


def bearing_rad(pose: Pose2D, point_m: tuple[float, float]) -> float:
    """Direction of a point as seen from the car, positive to the left, in [-pi, pi)."""
    return wrap_angle(atan2(point_m[1] - pose.y_m, point_m[0] - pose.x_m) - pose.heading_rad)
