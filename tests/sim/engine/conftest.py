import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import generate_world


@pytest.fixture(scope="session")
def blocky_world() -> WorldSpec:
    return generate_world("blocky", np.random.default_rng(3))


@pytest.fixture(scope="session")
def wall_world() -> WorldSpec:
    """A wall 15 m ahead of the start, the ball behind it."""
    return WorldSpec(
        name="wall",
        ball_xy_m=(40.0, 0.0),
        start=Pose2D(0.0, 0.0, 0.0),
        blocks=(Block(15.0, 0.0, 1.0, 10.0),),
    )


@pytest.fixture(scope="session")
def open_world() -> WorldSpec:
    return WorldSpec(name="open", ball_xy_m=(30.0, 0.0), start=Pose2D(0.0, 0.0, 0.0))
