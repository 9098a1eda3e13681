from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from steerlab.sim.errors import NoPath
from steerlab.sim.geometry import Pose2D, wrap_angle
from steerlab.sim.ground_truth import Planner
from steerlab.sim.ground_truth.label_path import turn_then_straight
from steerlab.sim.ground_truth.planner_inputs import ANY_ROUTE, Route, route_map, same_route
from steerlab.sim.vehicle import WHEEL_LIMIT

RADIUS_M = 6.5
coordinate = st.floats(-40.0, 40.0)
angle = st.floats(-pi, pi)
speed = st.floats(0.0, 8.0)


@settings(deadline=None)  # the first example may have to compile
@given(x=coordinate, y=coordinate, heading=angle, tx=coordinate, ty=coordinate, side=st.booleans())
def test_turn_then_straight_ends_at_the_point(
    x: float, y: float, heading: float, tx: float, ty: float, side: bool
) -> None:
    sign = 1.0 if side else -1.0
    turn, straight_m = turn_then_straight(x, y, heading, sign, RADIUS_M, tx, ty)
    centre = np.array((x - sign * RADIUS_M * sin(heading), y + sign * RADIUS_M * cos(heading)))
    inside = np.hypot(*(centre - (tx, ty))) < RADIUS_M
    assume(abs(np.hypot(*(centre - (tx, ty))) - RADIUS_M) > 1e-6)
    assert (straight_m < 0.0) == inside
    assume(not inside)
    end = heading + sign * turn
    leave = centre + sign * RADIUS_M * np.array((sin(end), -cos(end)))
    reached = leave + straight_m * np.array((cos(end), sin(end)))
    np.testing.assert_allclose(reached, (tx, ty), atol=1e-5)
    assert 0.0 <= turn < 2 * pi


@settings(deadline=None)
@given(x=coordinate, y=coordinate, heading=angle, speed_mps=speed)
def test_labels_are_bounded_and_paths_lead_from_the_rear_axle_to_the_ball(
    random_planner: Planner, x: float, y: float, heading: float, speed_mps: float
) -> None:
    pose = Pose2D(x, y, heading)
    try:
        label = random_planner.label(pose, speed_mps)
    except NoPath:
        return
    assert abs(label) <= WHEEL_LIMIT
    path = random_planner.label_path(pose, speed_mps)
    rear = pose.ahead(-random_planner.car.wheelbase_m / 2)
    np.testing.assert_allclose(path.points[0], (rear.x_m, rear.y_m), atol=1e-9)
    np.testing.assert_allclose(path.points[-1], random_planner.world.ball_xy_m, atol=1e-9)
    assert abs(wrap_angle(path.heading[0] - heading)) < 1e-6
    gaps_m = np.hypot(*np.diff(path.points, axis=0).T)
    assert gaps_m.max() <= random_planner.config.path_step_m + 1e-9


@settings(deadline=None)
@given(x=st.floats(-30.0, 30.0), y=st.floats(-30.0, 30.0), heading=angle, speed_mps=speed)
def test_an_empty_world_in_the_mirror(
    empty_planner: Planner, x: float, y: float, heading: float, speed_mps: float
) -> None:
    pose = Pose2D(x, y, heading)
    rear = pose.ahead(-empty_planner.car.wheelbase_m / 2)
    ball_x_m, ball_y_m = empty_planner.world.ball_xy_m
    off_x, off_y = ball_x_m - rear.x_m, ball_y_m - rear.y_m
    ahead_m = off_x * cos(heading) + off_y * sin(heading)
    left_m = off_y * cos(heading) - off_x * sin(heading)
    assume(abs(left_m) > 1e-3)  # straight ahead or behind, left and right are equally good
    # beside the car, inside a turning circle, the random trees decide
    assume(hypot(ahead_m, abs(left_m) - RADIUS_M) > RADIUS_M + 0.01)
    mirrored = empty_planner.label(Pose2D(x, -y, -heading), speed_mps)
    assert np.isclose(mirrored, -empty_planner.label(pose, speed_mps), atol=1e-6)


def test_turns_towards_the_ball(empty_planner: Planner) -> None:
    assert empty_planner.label(Pose2D(-20.0, 0.0, 0.0), 5.0) == pytest.approx(0.0, abs=1e-9)
    assert empty_planner.label(Pose2D(-20.0, 0.0, -0.5), 5.0) > 1.0
    assert empty_planner.label(Pose2D(-20.0, 0.0, 0.5), 5.0) < -1.0


@pytest.mark.parametrize("heading", [pi - 0.1, -pi + 0.1])
def test_turns_round_once_past_the_ball(empty_planner: Planner, heading: float) -> None:
    label = empty_planner.label(Pose2D(-0.0, 0.0, heading), 5.0)
    assert np.sign(label) == -np.sign(heading)
    assert abs(label) > 1.5


def test_inside_both_turning_circles_it_drives_away_first(empty_planner: Planner) -> None:
    beside = Pose2D(20.0 + 1.3, 6.0, 0.0)  # the ball abreast: nearer than two turning radii
    path = empty_planner.label_path(beside)
    assert path.length_m > 2 * pi * 3.0
    assert abs(empty_planner.label(beside, 5.0)) <= WHEEL_LIMIT


@pytest.mark.parametrize("gap_m", [0.05, 0.15, 0.3])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_nearer_than_the_margin_it_steers_clear(
    wall_planner: Planner, gap_m: float, side: float
) -> None:
    """Along the block's flank, less than the margin away and heading a little into it."""
    along = Pose2D(0.0, side * (6.0 + 0.9 + gap_m + 0.2), -side * 0.05)
    assert side * wall_planner.label(along, 5.0) > 0.0


@pytest.mark.parametrize("ahead_m", [4.5, 5.5, 7.0])
def test_close_before_a_block_it_turns_hard(wall_planner: Planner, ahead_m: float) -> None:
    before = Pose2D(-2.0 - 2.1 - ahead_m, 3.0, 0.3)
    assert wall_planner.label(before, 5.0) > 1.0


def test_routes_that_share_a_corner_are_one(wall_planner: Planner) -> None:
    tree = wall_planner.point_tree
    routes = route_map(tree)
    corners = tree.points[tree.corners]
    above = int(np.flatnonzero((corners[:, 0] < 0) & (corners[:, 1] > 0))[0])
    below = int(np.flatnonzero((corners[:, 0] < 0) & (corners[:, 1] < 0))[0])
    beyond = int(np.flatnonzero((corners[:, 0] > 0) & (corners[:, 1] > 0) & (corners[:, 0] < 9))[0])
    assert routes.together[above, beyond]
    assert not routes.together[above, below]
    over = Route(0.2, above)
    assert same_route(routes, over, -0.1, int(tree.corners[beyond]))
    assert same_route(routes, over, 0.0, 0)  # the ball lies on every route
    assert not same_route(routes, over, 0.1, int(tree.corners[below]))
    assert not same_route(routes, Route(1.0, 0), -1.0, 0)  # the other way round
    assert same_route(routes, ANY_ROUTE, 3.0, int(tree.corners[below]))
