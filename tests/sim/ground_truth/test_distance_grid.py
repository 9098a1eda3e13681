import mujoco
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.engine.driving import Driving
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth.distance_grid import (
    Keep,
    body_of,
    clearance_at,
    collision,
    distance_at,
    distance_grid,
    needed_clearance_m,
    overlaps,
    square_distance_grid,
)
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import generate_world

WORLD = generate_world("grid", np.random.default_rng(3))
GRID = distance_grid(WORLD, 0.25)
SQUARE = square_distance_grid(WORLD, 0.25)
CAR = CarConfig()
BODY = body_of(CAR)

coordinate = st.floats(-49.9, 49.9)
angle = st.floats(-np.pi, np.pi)


@settings(deadline=None)  # the first example may have to compile
@given(x=coordinate, y=coordinate)
def test_matches_the_exact_distance(x: float, y: float) -> None:
    blocks = min(block.distance_m(x, y) for block in WORLD.blocks)
    exact = min(blocks, 50.0 - max(abs(x), abs(y)))
    # inside a block the grid is negative, where the exact distance to it is 0
    assert abs(max(distance_at(GRID, x, y), 0.0) - exact) < 0.75 * GRID.cell_m


@settings(deadline=None)  # the first example may have to compile
@given(x=coordinate, y=coordinate)
def test_square_distance_is_never_the_larger(x: float, y: float) -> None:
    assert distance_at(SQUARE, x, y) <= distance_at(GRID, x, y) + 1e-9


@settings(deadline=None)  # the first example may have to compile
@given(x=coordinate, y=coordinate, heading=angle)
def test_clear_discs_mean_a_clear_car(x: float, y: float, heading: float) -> None:
    rear = Pose2D(x, y, heading).ahead(-CAR.wheelbase_m / 2)
    clear_m = clearance_at(GRID, BODY, rear.x_m, rear.y_m, heading)
    if clear_m > BODY.radius_m + GRID.cell_m:
        assert collision(Pose2D(x, y, heading), WORLD, CAR) is None


def test_is_negative_off_the_ground_and_in_a_block() -> None:
    world = WorldSpec(
        name="one",
        ball_xy_m=(20.0, 0.0),
        start=Pose2D(-20.0, 0.0, 0.0),
        blocks=(Block(0.0, 0.0, 3.0, 2.0),),
    )
    grid = distance_grid(world, 0.25)
    assert distance_at(grid, 0.0, 0.0) == -2.0
    assert distance_at(grid, 51.0, 0.0) == -1.0
    assert np.isclose(distance_at(grid, 7.0, 5.0), 5.0)  # 3-4-5 from the corner (3, 2)


def test_cells_fill_a_ground_of_any_size() -> None:
    world = WorldSpec(
        name="odd", ball_xy_m=(5.0, 0.0), start=Pose2D(-5.0, 0.0, 0.0), half_extent_m=10.1
    )
    grid = distance_grid(world, 0.25)
    assert grid.cell_m <= 0.25
    assert np.isclose((len(grid.distance_m) - 1) * grid.cell_m, 20.2)


def test_needed_clearance_rises_from_what_the_car_has() -> None:
    keep = Keep(0.9, 1.5, 4.0)
    assert needed_clearance_m(keep, 0.0) == 0.9
    assert np.isclose(needed_clearance_m(keep, 2.0), 1.2)
    assert needed_clearance_m(keep, 40.0) == 1.5


def test_rectangle_is_exact_where_the_discs_are_not() -> None:
    beside = Pose2D(0.0, 2.0 + 0.9 + 0.01, 0.0)  # a hand's breadth from the block's face
    world = WorldSpec(
        name="one",
        ball_xy_m=(20.0, 0.0),
        start=Pose2D(-20.0, 0.0, 0.0),
        blocks=(Block(0.0, 0.0, 3.0, 2.0),),
    )
    assert collision(beside, world, CAR) is None
    assert "Block" in (collision(Pose2D(0.0, 2.0 + 0.9 - 0.01, 0.0), world, CAR) or "")
    assert "off the ground" in (collision(Pose2D(50.1, 0.0, 0.0), world, CAR) or "")
    corner = Pose2D(3.0 + 1.4, 2.0 + 1.4, -np.pi / 4)  # its side along the corner's diagonal
    assert collision(corner, world, CAR) is None
    assert collision(Pose2D(corner.x_m, corner.y_m, np.pi / 4), world, CAR) is not None


def test_the_rectangle_agrees_with_mujoco() -> None:
    rng = np.random.default_rng(0)
    seen = set()
    with Driving(WORLD) as car:
        for _ in range(500):
            block = WORLD.blocks[int(rng.integers(len(WORLD.blocks)))]
            share_x, share_y = rng.uniform(-1.0, 1.0, size=2).tolist()
            pose = Pose2D(
                block.x_m + share_x * (block.half_x_m + 2.3),
                block.y_m + share_y * (block.half_y_m + 2.3),
                float(rng.uniform(-np.pi, np.pi)),
            )
            car.data.qpos[:3] = pose.x_m, pose.y_m, pose.heading_rad
            mujoco.mj_forward(car.model, car.data)
            touching = any(overlaps(pose, other, CAR) for other in WORLD.blocks)
            assert touching == bool((car.data.contact.dist < 0.0).any())
            seen.add(touching)
    assert seen == {True, False}
