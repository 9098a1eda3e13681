"""One turn and the straight after it: their lengths, and how much room they leave."""

from math import acos, atan2, cos, pi, sin, sqrt

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.distance_grid import (
    Keep,
    clearance_at,
    distance_at,
    needed_clearance_m,
)
from steerlab.sim.ground_truth.dubins import turn_angle
from steerlab.sim.ground_truth.planner_inputs import RAMP_M, PlannerInputs
from steerlab.sim.world import REACH_M

LEAST_STEP_M = 0.2  # of a collision check
BLOCKED = np.inf


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
def free_turns(task: PlannerInputs, pose: tuple[float, float, float], start_m: float) -> FloatArray:
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
def squeeze(
    task: PlannerInputs, pose: tuple[float, float, float], turn: float, radius_m: float, node: int,
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
            return BLOCKED
        wanted_m = needed_clearance_m(keep_square, turn_m + ahead_m)
        spare_m = distance_at(task.square_grid, on_x, on_y) - wanted_m
        squeeze_m = max(squeeze_m, -spare_m)
        ahead_m += max(LEAST_STEP_M, 0.7 * spare_m)
    return squeeze_m
