"""Seeded random worlds that a car can drive through."""

from dataclasses import dataclass
from math import atan2, hypot

import numpy as np

from steerlab.sim.errors import InvalidConfig, InvalidWorld
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M, Block, WorldSpec

PLANNING_MARGIN_M = 0.4  # kept between the car's discs and a block, on top of the disc radius


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """How random worlds look; lengths in metres."""

    half_extent_m: float = 50.0
    blocks: tuple[int, int] = (10, 25)  # fewest and most blocks, both included
    half_size_m: tuple[float, float] = (1.0, 4.0)
    height_m: tuple[float, float] = (1.5, 4.0)
    min_start_to_ball_m: float = 45.0
    start_clearance_m: float = 8.0  # free of blocks around the start: room to begin a turn
    start_heading_spread_rad: float = 0.6  # around the direction to the ball
    spare_gap_m: float = 1.5  # two blocks overlap or leave 2 * inflation + this

    def __post_init__(self) -> None:
        fewest, most = self.blocks
        if not 0 <= fewest <= most:
            raise InvalidConfig(f"blocks is {self.blocks}; give (fewest, most) with 0 <= fewest.")
        for name, value in vars(self).items():
            if not np.isfinite(value).all():
                raise InvalidConfig(f"{name} is {value}; it must be finite.")
        if self.min_start_to_ball_m > 1.6 * self.half_extent_m:
            raise InvalidConfig(
                f"min_start_to_ball_m {self.min_start_to_ball_m} does not fit a ground of "
                f"±{self.half_extent_m} m; lower it."
            )

    def min_gap_m(self, car: CarConfig) -> float:
        """The narrowest gap two blocks may leave: slivers would choke the planner's tree."""
        return 2.0 * (car.disc_radius_m + PLANNING_MARGIN_M) + self.spare_gap_m


def generate_world(
    name: str,
    rng: np.random.Generator,
    config: WorldConfig | None = None,
    car: CarConfig | None = None,
) -> WorldSpec:
    """Draw a world that keeps the minimum-gap rule; the same rng state gives the same world.

    That the ball can be *driven to* is decided by ``steerlab.sim.ground_truth``.

    Raises:
        InvalidWorld: no such world was found in a thousand tries (too many or too large blocks).
    """
    config = config or WorldConfig()
    car = car or CarConfig()
    ball, start = _ball_and_start(rng, config, car)
    wanted = int(rng.integers(config.blocks[0], config.blocks[1] + 1))
    min_gap_m = config.min_gap_m(car)
    blocks: list[Block] = []
    for _ in range(1000):
        if len(blocks) == wanted:
            return WorldSpec(
                name=name,
                ball_xy_m=ball,
                start=start,
                blocks=tuple(blocks),
                half_extent_m=config.half_extent_m,
            )
        block = _draw_block(rng, config)
        clear_of_start = block.distance_m(start.x_m, start.y_m) > config.start_clearance_m
        clear_of_ball = block.distance_m(*ball) > BALL_RADIUS_M + min_gap_m
        if clear_of_start and clear_of_ball and _keeps_gaps(block, blocks, config, min_gap_m):
            blocks.append(block)
    raise InvalidWorld(
        f"World {name!r}: only {len(blocks)} of {wanted} blocks fit on ±{config.half_extent_m:g} m "
        f"with gaps of {min_gap_m:.1f} m; ask for fewer or smaller blocks."
    )


def _ball_and_start(
    rng: np.random.Generator, config: WorldConfig, car: CarConfig
) -> tuple[tuple[float, float], Pose2D]:
    reach_m = config.half_extent_m - car.length_m - 2.0 * BALL_RADIUS_M
    while True:
        start_x, start_y, ball_x, ball_y = rng.uniform(-reach_m, reach_m, size=4)
        if hypot(ball_x - start_x, ball_y - start_y) >= config.min_start_to_ball_m:
            spread_rad = config.start_heading_spread_rad
            heading_rad = atan2(ball_y - start_y, ball_x - start_x)
            heading_rad += float(rng.uniform(-spread_rad, spread_rad))
            return (float(ball_x), float(ball_y)), Pose2D(
                float(start_x), float(start_y), heading_rad
            )


def _draw_block(rng: np.random.Generator, config: WorldConfig) -> Block:
    x_m, y_m = rng.uniform(-config.half_extent_m, config.half_extent_m, size=2)
    half_x_m, half_y_m = rng.uniform(*config.half_size_m, size=2)
    return Block(
        float(x_m),
        float(y_m),
        float(half_x_m),
        float(half_y_m),
        float(rng.uniform(*config.height_m)),
    )


def _keeps_gaps(block: Block, others: list[Block], config: WorldConfig, min_gap_m: float) -> bool:
    """Whether each block, and the ground's edge, is either overlapped or far enough away."""
    edge_gap_m = config.half_extent_m - max(
        abs(block.x_m) + block.half_x_m, abs(block.y_m) + block.half_y_m
    )
    if 0.0 < edge_gap_m < min_gap_m:
        return False
    return all(not 0.0 < block.gap_m(other) < min_gap_m for other in others)
