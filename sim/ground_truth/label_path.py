"""The path a label is read from: turn, then straight to the best node of the point tree.

A fresh random tree at each step, as in the paper, jumps between routes. Here the first turn is
exact and everything after it comes from one field of distances, so that the path, and with it
the label, changes as smoothly as the car's pose.
"""

from math import acos, atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.ground_truth.bicycle import can_follow
from steerlab.sim.ground_truth.distance_grid import (
    Body,
    DistanceGrid,
    Keep,
    clearance_at,
    distance_at,
    needed_clearance_m,
)
from steerlab.sim.ground_truth.dubins import turn_angle
from steerlab.sim.ground_truth.path_writer import write_turn, write_way
from steerlab.sim.ground_truth.route import Route, RouteMap, same_route
from steerlab.sim.ground_truth.rrt_star import PointTree
from steerlab.sim.ground_truth.stanley import Steering
from steerlab.sim.world import REACH_M

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_POINTS = 2048
MOST_DRIVES = 3  # candidates of each side and radius driven in simulation before giving up
MOST_LOOKS = 256  # candidates looked at before giving up
RAMP_M = 4.0  # within which a car that is too near a block must have got clear of it
TOUCH_M = 0.1  # a car too near a block may come this much nearer: discs are wider than it is
LEAST_STEP_M = 0.2  # of a collision check
SQUEEZE_COST = 10.0  # metres of detour worth one metre inside the margin
NO_CANDIDATE = np.inf


class Task(NamedTuple):
    """What ``turn_and_go`` needs to know about the world and the car.

    Attributes:
        square_grid: distances in the maximum norm; see ``square_distance_grid``.
        radii_m: planned and tightest turning radius.
        extra_m: what a turn at each of these radii costs on top of its length.
        clearance_m: what the car must keep on a path with each of these radii.
        grown_m: by how much the blocks of the point tree are grown.
    """

    tree: PointTree
    routes: RouteMap
    grid: DistanceGrid
    square_grid: DistanceGrid
    body: Body
    steering: Steering
    ball: tuple[float, float]
    radii_m: tuple[float, float]
    extra_m: tuple[float, float]
    clearance_m: tuple[float, float]
    grown_m: float
    path_step_m: float
    hysteresis_m: float
    verify_s: float


@njit(cache=True)
def turn_then_straight(
    x_m: float, y_m: float, heading_rad: float, side: float, radius_m: float,
    to_x_m: float, to_y_m: float,
) -> tuple[float, float]:  # fmt: skip
    """Turn angle and straight length from a pose to a point; (0, -1) from inside the circle."""
    centre_x = x_m - side * radius_m * sin(heading_rad)
    centre_y = y_m + side * radius_m * cos(heading_rad)
    dx, dy = to_x_m - centre_x, to_y_m - centre_y
    squared = dx * dx + dy * dy
    if squared < radius_m * radius_m:
        return 0.0, -1.0
    # the tangent to the point leaves the circle acos(r / d) before the direction of the point
    leave = side * atan2(dy, dx) - acos(radius_m / sqrt(squared))
    turn = turn_angle(leave - side * heading_rad + pi / 2.0)
    return turn, sqrt(squared - radius_m * radius_m)


@njit(cache=True)
def turn_and_go(
    task: Task, pose: tuple[float, float, float], speed_mps: float, nodes: IntArray,
    max_kink_rad: float, before: Route, remembers: bool, points: FloatArray, heading: FloatArray,
) -> tuple[int, Route]:  # fmt: skip
    """Find the cheapest drivable turn-and-straight onto one of ``nodes``, and write its path.

    Candidates are every node, left and right, at both radii. The cheapest is looked at first; one
    that squeezes past a block goes back among the others at a higher cost.

    Args:
        task: the world and the car.
        pose: of the rear axle.
        speed_mps: at which the path must be drivable.
        nodes: (n,) candidates of ``task.tree``.
        max_kink_rad: sharpest corner allowed where the straight ends.
        before: route to stay on.
        remembers: whether there was a route before.
        points: (MAX_POINTS, 2) buffer for the path to the ball.
        heading: (MAX_POINTS,) likewise.

    Returns:
        number of path points, 0 if no candidate can be driven; the route taken.
    """
    count = nodes.shape[0]
    start_m = min(clearance_at(task.grid, task.body, *pose) - TOUCH_M, task.body.radius_m)
    free_turns = _free_turns(task, pose, start_m)
    cost, turns = _candidates(task, pose, nodes, max_kink_rad, before, remembers, free_turns)
    looked_at = np.zeros(cost.shape[0], dtype=np.bool_)
    drives = np.zeros(4, dtype=np.int64)
    for _ in range(MOST_LOOKS):
        k = int(np.argmin(cost))
        if cost[k] == NO_CANDIDATE:
            break
        node, kind, tight = int(nodes[k % count]), k // count, k // (2 * count)
        radius_m = task.radii_m[tight]
        if not looked_at[k]:
            looked_at[k] = True
            keep = Keep(start_m, task.clearance_m[tight], RAMP_M)
            squeeze_m = _squeeze(task, pose, turns[k], radius_m, node, keep)
            if squeeze_m > 0.0:
                cost[k] += SQUEEZE_COST * squeeze_m
                continue
        cost[k] = NO_CANDIDATE
        if drives[kind] == MOST_DRIVES:
            continue
        drives[kind] += 1
        row = write_turn(pose, turns[k], radius_m, task.path_step_m, points, heading)
        length = write_way(task.tree, node, task.radii_m[0], task.path_step_m, row, points, heading)
        if can_follow(
            points[:length], heading[:length], pose, speed_mps, task.verify_s, task.ball,
            task.grid, task.body, task.steering, Keep(start_m, task.body.radius_m, RAMP_M),
        ):  # fmt: skip
            return length, Route(turns[k], int(task.routes.corner_of[node]))
    return 0, before


@njit(cache=True)
def _free_turns(task: Task, pose: tuple[float, float, float], start_m: float) -> FloatArray:
    """(4,) how far the car can turn left, right, and the same at the tight radius, in radians."""
    x, y, bearing = pose
    free = np.empty(4)
    for kind in range(4):
        side, radius_m = (1.0 if kind % 2 == 0 else -1.0), task.radii_m[kind // 2]
        keep = Keep(start_m, task.clearance_m[kind // 2], RAMP_M)
        free[kind], turn = 0.0, 0.0
        while turn < 2.0 * pi:
            angle = bearing + side * turn
            at_x = x + side * radius_m * (sin(angle) - sin(bearing))
            at_y = y - side * radius_m * (cos(angle) - cos(bearing))
            needed_m = needed_clearance_m(keep, radius_m * turn)
            spare_m = clearance_at(task.grid, task.body, at_x, at_y, angle) - needed_m
            if spare_m < 0.0:
                break
            free[kind] = turn
            turn += max(LEAST_STEP_M, 0.7 * spare_m) / radius_m
    return free


@njit(cache=True)
def _candidates(
    task: Task, pose: tuple[float, float, float], nodes: IntArray, max_kink_rad: float,
    before: Route, remembers: bool, free_turns: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """(4 n,) costs in metres and signed turns: left, right, then the same at the tight radius."""
    x, y, bearing = pose
    tree, count = task.tree, nodes.shape[0]
    cost, turns = np.full(4 * count, NO_CANDIDATE), np.zeros(4 * count)
    for k in range(4 * count):
        tight, node = k // (2 * count), int(nodes[k % count])
        side = 1.0 if (k // count) % 2 == 0 else -1.0
        to, radius_m = tree.points[node], task.radii_m[tight]
        turn, straight_m = turn_then_straight(x, y, bearing, side, radius_m, to[0], to[1])
        if straight_m < 0.0 or turn > free_turns[k // count]:
            continue
        onward = tree.parent[node]
        if onward >= 0:
            leg = tree.points[onward] - to
            kink = atan2(leg[1], leg[0]) - bearing - side * turn
            if cos(kink) < cos(max_kink_rad):
                continue
        turns[k] = side * turn
        # charged as if at the planned radius: a tight turn is for need, not for saving length
        cost[k] = task.radii_m[0] * turn + straight_m + tree.cost_m[node] + task.extra_m[tight]
        if remembers and not same_route(task.routes, before, turns[k], node):
            cost[k] += task.hysteresis_m
    return cost, turns


@njit(cache=True)
def _squeeze(
    task: Task, pose: tuple[float, float, float], turn: float, radius_m: float, node: int,
    keep: Keep,
) -> float:  # fmt: skip
    """How far the straight after a turn enters the grown blocks; infinite if the car must touch.

    Square distances are what the tree's costs are built on: held to them, a straight past a
    corner appears just when the car has it abreast, and the label does not jump.
    """
    x, y, bearing = pose
    side, turn_m, angle = (1.0 if turn >= 0.0 else -1.0), radius_m * abs(turn), bearing + turn
    at_x = x + side * radius_m * (sin(angle) - sin(bearing))
    at_y = y - side * radius_m * (cos(angle) - cos(bearing))
    to = task.tree.points[node]
    straight_m = sqrt((to[0] - at_x) ** 2 + (to[1] - at_y) ** 2)
    if node == 0:  # the drive is over once the car's centre is within reach of the ball
        straight_m -= REACH_M
    now_m = min(distance_at(task.square_grid, x, y), task.grown_m)
    keep_square = Keep(now_m, task.grown_m, keep.ramp_m)
    squeeze_m, ahead_m = 0.0, 0.0
    while ahead_m < straight_m:
        on_x, on_y = at_x + ahead_m * cos(angle), at_y + ahead_m * sin(angle)
        needed_m = needed_clearance_m(keep, turn_m + ahead_m)
        if distance_at(task.grid, on_x, on_y) < needed_m:
            return NO_CANDIDATE
        wanted_m = needed_clearance_m(keep_square, turn_m + ahead_m)
        spare_m = distance_at(task.square_grid, on_x, on_y) - wanted_m
        squeeze_m = max(squeeze_m, -spare_m)
        ahead_m += max(LEAST_STEP_M, 0.7 * spare_m)
    return squeeze_m
