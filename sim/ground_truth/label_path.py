"""The path a label is read from: turn, then straight to the best node of the point tree.

A fresh random tree at each step, as in the paper, jumps between routes. Here the first turn is
exact and everything after it comes from one field of distances, so that the path, and with it
the label, changes as smoothly as the car's pose.
"""

from math import atan2, cos

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.bicycle import spare_following
from steerlab.sim.ground_truth.distance_grid import Keep, clearance_at
from steerlab.sim.ground_truth.path_writer import write_turn, write_way
from steerlab.sim.ground_truth.planner_inputs import DRIVE_SLACK_M, RAMP_M, PlannerInputs, verified
from steerlab.sim.ground_truth.route import Route, same_route
from steerlab.sim.ground_truth.turns import BLOCKED, free_turns, squeeze, turn_then_straight

IntArray = NDArray[np.int64]

MAX_POINTS = 2048
MOST_DRIVES = 3  # candidates of each side and radius driven in simulation before giving up
MOST_LOOKS = 256  # at candidates before giving up
TOUCH_M = 0.1  # a car too near a block may come this much nearer: discs are wider than it is
SQUEEZE_COST = 10.0  # metres of detour worth one metre inside the margin
GRAZE_COST = 100.0  # metres of detour worth one metre that discs overlap a block on the drive
LOOKED_AT, DRIVEN = 1, 2  # what has been done with a candidate


@njit(cache=True)
def turn_and_go(
    task: PlannerInputs, pose: tuple[float, float, float], speed_mps: float, nodes: IntArray,
    max_kink_rad: float, before: Route, remembers: bool, points: FloatArray, heading: FloatArray,
) -> tuple[int, Route]:  # fmt: skip
    """Find the cheapest drivable turn-and-straight onto one of ``nodes``, and write its path.

    Candidates are every node, left and right, at both radii. The cheapest is looked at, then
    driven in simulation, and goes back among the others if that made it dearer.

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
    if count == 0:
        return 0, before
    start_m = min(clearance_at(task.grid, task.body, *pose) - TOUCH_M, task.body.radius_m)
    free_rad = free_turns(task, pose, start_m)
    cost, turns = _candidates(task, pose, nodes, max_kink_rad, before, remembers, free_rad)
    steps_done = np.zeros(cost.shape[0], dtype=np.int64)
    drives = np.zeros(4, dtype=np.int64)
    for _ in range(MOST_LOOKS):
        k = int(np.argmin(cost))
        if cost[k] == BLOCKED:
            break
        node, kind, tight = int(nodes[k % count]), k // count, k // (2 * count)
        radius_m = task.radii_m[tight]
        steps_done[k] += 1
        if steps_done[k] == LOOKED_AT:
            keep = Keep(start_m, task.clearance_m[tight], RAMP_M)
            cost[k] += SQUEEZE_COST * squeeze(task, pose, turns[k], radius_m, node, keep)
            continue
        row = write_turn(pose, turns[k], radius_m, task.path_step_m, points, heading)
        length = write_way(task.tree, node, task.radii_m[0], task.path_step_m, row, points, heading)
        if steps_done[k] > DRIVEN:
            return length, Route(turns[k], int(task.routes.corner_of[node]))
        drives[kind] += 1
        spare_m = -1.0
        if drives[kind] <= MOST_DRIVES:
            spare_m = spare_following(
                points[:length], heading[:length], pose, speed_mps, task.verify_s, task.ball,
                task.grid, task.body, task.steering, verified(task.body, start_m),
            )  # fmt: skip
        if spare_m < 0.0:
            cost[k] = BLOCKED
        else:
            cost[k] += GRAZE_COST * max(DRIVE_SLACK_M - spare_m, 0.0)
    return 0, before


@njit(cache=True)
def _candidates(
    task: PlannerInputs, pose: tuple[float, float, float], nodes: IntArray, max_kink_rad: float,
    before: Route, remembers: bool, free_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """(4 n,) costs in metres and signed turns: left, right, then the same at the tight radius."""
    x, y, bearing = pose
    tree, count = task.tree, nodes.shape[0]
    cost, turns = np.full(4 * count, BLOCKED), np.zeros(4 * count)
    for k in range(4 * count):
        tight, node = k // (2 * count), int(nodes[k % count])
        side = 1.0 if (k // count) % 2 == 0 else -1.0
        to, radius_m = tree.points[node], task.radii_m[tight]
        turn, straight_m = turn_then_straight(x, y, bearing, side, radius_m, to[0], to[1])
        if straight_m < 0.0 or turn > free_rad[k // count]:
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
