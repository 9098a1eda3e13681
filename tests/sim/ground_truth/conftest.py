"""Small worlds and planners that the ground-truth tests share."""

import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import Planner, PlannerConfig
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import generate_world


def _ring(inner_m: float) -> tuple[Block, ...]:
    """Four blocks that leave a square room of half size ``inner_m`` around the origin."""
    mid_m, half_m = inner_m + 1.0, inner_m + 2.0
    return (
        Block(mid_m, 0.0, 1.0, half_m),
        Block(-mid_m, 0.0, 1.0, half_m),
        Block(0.0, mid_m, half_m, 1.0),
        Block(0.0, -mid_m, half_m, 1.0),
    )


def _world(name: str, ball: tuple[float, float], *blocks: Block) -> WorldSpec:
    return WorldSpec(name=name, ball_xy_m=ball, start=Pose2D(-40.0, 0.0, 0.0), blocks=blocks)


@pytest.fixture(scope="session")
def random_world() -> WorldSpec:
    return generate_world("random", np.random.default_rng(7))


@pytest.fixture(scope="session")
def random_planner(random_world: WorldSpec) -> Planner:
    return Planner(random_world, seed=7)


@pytest.fixture(scope="session")
def empty_planner() -> Planner:
    return Planner(_world("empty", (20.0, 0.0)), seed=0, config=PlannerConfig(nodes=500))


@pytest.fixture(scope="session")
def wall_world() -> WorldSpec:
    """One block straight between a car coming along the x axis and the ball."""
    return _world("wall", (30.0, 0.0), Block(0.0, 0.0, 2.0, 6.0))


@pytest.fixture(scope="session")
def wall_planner(wall_world: WorldSpec) -> Planner:
    return Planner(wall_world, seed=0)


@pytest.fixture(scope="session")
def walled_in_ball() -> Planner:
    """No room for a car within reach of the ball."""
    return Planner(_world("walled-in", (0.0, 0.0), *_ring(2.5)), seed=0)


@pytest.fixture(scope="session")
def locked_room() -> Planner:
    """Room for a car around the ball, but no door."""
    return Planner(_world("locked", (0.0, 0.0), *_ring(12.0)), seed=0)
