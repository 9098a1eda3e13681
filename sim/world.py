"""What a world is: ground, blocks, a ball to reach, and where the car starts."""

from dataclasses import asdict, dataclass
from math import hypot, isfinite
from typing import Any

from steerlab.sim.errors import InvalidValue, InvalidWorld
from steerlab.sim.files.structured import structured
from steerlab.sim.geometry import Pose2D

BALL_RADIUS_M = 2.0
REACH_M = 4.5  # car centre to ball centre: the bumper (2.1 m ahead) is then at the ball's surface


@dataclass(frozen=True, slots=True)
class Block:
    """An axis-aligned box standing on the ground; sizes are half sizes, as in MuJoCo."""

    x_m: float
    y_m: float
    half_x_m: float
    half_y_m: float
    height_m: float = 2.5

    def __post_init__(self) -> None:
        numbers = (self.x_m, self.y_m, self.half_x_m, self.half_y_m, self.height_m)
        if not all(map(isfinite, numbers)):
            raise InvalidWorld(f"{self} has a number that is not finite.")
        if not min(self.half_x_m, self.half_y_m, self.height_m) > 0.0:
            raise InvalidWorld(f"{self} has a size that is not positive.")

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Distance from a point to the block's footprint, 0 inside."""
        dx = max(abs(x_m - self.x_m) - self.half_x_m, 0.0)
        dy = max(abs(y_m - self.y_m) - self.half_y_m, 0.0)
        return hypot(dx, dy)

    def gap_m(self, other: "Block") -> float:
        """Free distance between two blocks, 0 if they touch or overlap."""
        dx = max(abs(self.x_m - other.x_m) - self.half_x_m - other.half_x_m, 0.0)
        dy = max(abs(self.y_m - other.y_m) - self.half_y_m - other.half_y_m, 0.0)
        return hypot(dx, dy)


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldSpec:
    """A square ground of side ``2 * half_extent_m`` centred on the origin.

    Raises:
        InvalidWorld: the ball or the start lies outside the ground or inside a block, or a number
            is not finite.
    """

    name: str
    ball_xy_m: tuple[float, float]
    start: Pose2D
    blocks: tuple[Block, ...] = ()
    half_extent_m: float = 50.0

    def __post_init__(self) -> None:
        start = self.start
        numbers = (*self.ball_xy_m, start.x_m, start.y_m, start.heading_rad, self.half_extent_m)
        if not all(map(isfinite, numbers)):
            raise InvalidWorld(
                f"World {self.name!r}: ball {self.ball_xy_m}, {start} and ground of "
                f"±{self.half_extent_m} m must be finite."
            )
        for what, (x_m, y_m), clearance_m in (
            ("ball", self.ball_xy_m, BALL_RADIUS_M),
            ("start", (self.start.x_m, self.start.y_m), 0.0),
        ):
            if max(abs(x_m), abs(y_m)) > self.half_extent_m:
                raise InvalidWorld(
                    f"World {self.name!r}: the {what} at ({x_m:g}, {y_m:g}) m lies outside the "
                    f"ground of ±{self.half_extent_m:g} m; move it inside."
                )
            for block in self.blocks:
                if block.distance_m(x_m, y_m) <= clearance_m:
                    raise InvalidWorld(
                        f"World {self.name!r}: the {what} at ({x_m:g}, {y_m:g}) m lies inside "
                        f"{block}; move one of them."
                    )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "WorldSpec":
        """The inverse of ``to_dict``.

        Raises:
            InvalidWorld: a field is missing, unknown or breaks a rule.
        """
        try:
            return structured(cls, values)
        except InvalidValue as error:
            raise InvalidWorld(f"Not a world: {error}") from error
