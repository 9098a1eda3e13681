"""Camera settings and viewpoints; kept out of ``engine`` so that naming a view does not load MuJoCo."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, hypot, radians, sin, tan
from typing import Literal, NamedTuple, get_args

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig

View = Literal["driver", "front", "chase"]
MAX_SIDE_PX = 4096
MOST_SAMPLES = 16


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Size in pixels and view; ``samples`` > 0 smooths edges and is slow on software OpenGL.

    ``front`` is on the bumper and is what policies see; ``driver`` is behind the hood.
    """

    width: int = 64
    height: int = 64
    view: View = "front"
    samples: int = 0

    def __post_init__(self) -> None:
        if not (0 < self.width <= MAX_SIDE_PX and 0 < self.height <= MAX_SIDE_PX):
            raise InvalidConfig(
                f"A camera of {self.width} x {self.height} px; both must be 1 to {MAX_SIDE_PX}."
            )
        if self.view not in get_args(View):
            raise InvalidConfig(f"View {self.view!r}; choose one of {', '.join(get_args(View))}.")
        if not 0 <= self.samples <= MOST_SAMPLES:
            raise InvalidConfig(f"samples is {self.samples}; give 0 to {MOST_SAMPLES}.")


class Seen(NamedTuple):
    """Where a point is in a picture: pixels from its top left, and metres ahead of the camera.

    Behind the camera (``ahead_m`` not positive) the pixels say nothing but the side.
    """

    x_px: float
    y_px: float
    ahead_m: float


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A camera on the car's middle line that looks ahead and a little down.

    Attributes:
        x_m, z_m: ahead of the car's centre, and above the ground.
        down: metres that it looks down for each metre ahead.
        fov_deg: from the lower to the upper edge of the picture.
    """

    x_m: float
    z_m: float
    down: float
    fov_deg: float

    def seen(
        self, pose: Pose2D, point_m: tuple[float, float, float], size_px: tuple[int, int]
    ) -> Seen:
        """Where a point of the world is in a picture of ``size_px``, from a car at ``pose``."""
        east_m, north_m = point_m[0] - pose.x_m, point_m[1] - pose.y_m
        cosine, sine = cos(pose.heading_rad), sin(pose.heading_rad)
        forward_m = cosine * east_m + sine * north_m - self.x_m
        left_m = cosine * north_m - sine * east_m
        up_m, norm = point_m[2] - self.z_m, hypot(1.0, self.down)
        ahead_m = (forward_m - self.down * up_m) / norm
        above_m = (self.down * forward_m + up_m) / norm
        width, height = size_px
        px_m = height / 2.0 / tan(radians(self.fov_deg) / 2.0) / max(abs(ahead_m), 1e-6)
        return Seen(width / 2.0 - left_m * px_m, height / 2.0 - above_m * px_m, ahead_m)


def viewpoints(car: CarConfig) -> Mapping[View, Viewpoint]:
    """Where the cameras are on ``car``."""
    return {
        "front": Viewpoint(car.length_m / 2, 1.1, 0.12, 60.0),
        "chase": Viewpoint(-8.5, 4.2, 0.3, 55.0),
        "driver": Viewpoint(0.1, 1.4, 0.1, 60.0),
    }
