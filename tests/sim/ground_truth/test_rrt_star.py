from math import hypot, inf, isfinite

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import Planner
from steerlab.sim.ground_truth.boxes import FreeSpace, free_space, point_free, segment_free
from steerlab.sim.ground_truth.rrt_star import grow_point_tree
from steerlab.sim.ground_truth.visibility_graph import VisibilityGraph
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import generate_world

BOX = FreeSpace(np.array([[-2.0, 2.0, -1.0, 1.0]]), np.array([-10.0, 10.0, -10.0, 10.0]))
coordinate = st.floats(-10.0, 10.0)


@settings(deadline=None)  # the first example may have to compile
@given(ax=coordinate, ay=coordinate, bx=coordinate, by=coordinate)
def test_a_free_segment_has_only_free_points(ax: float, ay: float, bx: float, by: float) -> None:
    share = np.linspace(0.0, 1.0, 501)
    x, y = ax + share * (bx - ax), ay + share * (by - ay)
    inside_m = np.minimum(2.0 - np.abs(x), 1.0 - np.abs(y)).max()
    if segment_free(BOX, ax, ay, bx, by):
        assert inside_m < 1e-6
    else:
        assert inside_m > -0.1  # between two samples it may just clip a corner


def test_a_segment_may_touch_a_box() -> None:
    assert segment_free(BOX, -5.0, 1.0, 5.0, 1.0)
    assert segment_free(BOX, 2.0, -5.0, 2.0, 5.0)
    assert not segment_free(BOX, -5.0, 0.99, 5.0, 0.99)


def test_visibility_graph_on_a_hand_computed_world() -> None:
    world = WorldSpec(
        name="one",
        ball_xy_m=(10.0, 0.0),
        start=Pose2D(-10.0, 0.0, 0.0),
        blocks=(Block(0.0, 0.0, 1.0, 2.0),),
    )
    graph = VisibilityGraph(free_space(world, 1.0), world.ball_xy_m)
    around_m = 2.0 * hypot(8.0, 3.0) + 4.0  # over the corners (-2, 3) and (2, 3)
    assert np.isclose(graph.cost_to_go_m(-10.0, 0.0), around_m)
    assert np.isclose(graph.cost_to_go_m(5.0, 0.0), 5.0)
    assert graph.cost_to_go_m(0.0, 0.0) == inf


@pytest.mark.parametrize("seed", range(4))
def test_rrt_star_comes_within_half_a_percent_of_the_optimum(seed: int) -> None:
    world = generate_world("tree", np.random.default_rng(40 + seed))
    planner = Planner(world, seed=seed)
    exact = VisibilityGraph(planner.free_space, world.ball_xy_m)
    excess = []
    for x_m, y_m in np.random.default_rng(seed).uniform(-48.0, 48.0, size=(400, 2)).tolist():
        best_m = exact.cost_to_go_m(x_m, y_m)
        if isfinite(best_m):
            excess.append(planner.cost_to_go_m(x_m, y_m) / best_m - 1.0)
    assert min(excess) > -1e-9  # shorter than the shortest would mean through a block
    assert np.mean(excess) <= 0.005


def test_no_way_costs_infinitely_much(locked_room: Planner) -> None:
    assert locked_room.cost_to_go_m(-30.0, 0.0) == inf
    assert isfinite(locked_room.cost_to_go_m(5.0, 5.0))


def test_costs_are_the_lengths_of_free_paths(random_planner: Planner) -> None:
    tree, space = random_planner.point_tree, random_planner.free_space
    assert tree.cost_m[0] == 0.0
    assert tree.parent[0] == -1
    for node in range(1, len(tree.points), 37):
        to, at = tree.points[tree.parent[node]], tree.points[node]
        assert segment_free(space, *at, *to)
        assert point_free(space, *at)
        edge_m = np.hypot(*(to - at))
        assert np.isclose(tree.cost_m[node], tree.cost_m[tree.parent[node]] + edge_m)


def test_same_seed_same_bits(random_world: WorldSpec, random_planner: Planner) -> None:
    again, other = Planner(random_world, seed=7), Planner(random_world, seed=8)
    for name in ("points", "cost_m", "parent", "corners"):
        first, second = (getattr(p.point_tree, name) for p in (random_planner, again))
        assert first.tobytes() == second.tobytes()
    for name in ("poses", "cost_m", "parent"):
        first, second = (getattr(p.pose_tree, name) for p in (random_planner, again))
        assert first.tobytes() == second.tobytes()
    assert other.point_tree.points.tobytes() != again.point_tree.points.tobytes()


def test_a_ball_beside_a_block_stays_in_free_space() -> None:
    world = WorldSpec(
        name="beside",
        ball_xy_m=(0.0, 0.0),
        start=Pose2D(-20.0, 0.0, 0.0),
        blocks=(Block(3.45, 3.45, 2.0, 2.0),),  # corner at (1.45, 1.45): grown, it covers the ball
    )
    space = free_space(world, 1.54)
    assert point_free(space, 0.0, 0.0)
    tree = grow_point_tree(space, (0.0, 0.0), nodes=300, rng=np.random.default_rng(0))
    assert len(tree.points) > 250
