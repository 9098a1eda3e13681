"""A kinematic bicycle that follows a path: would the car touch anything, would it arrive?"""

from math import cos, hypot, sin, tan

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.distance_grid import (
    Body,
    DistanceGrid,
    Keep,
    clearance_at,
    needed_clearance_m,
)
from steerlab.sim.ground_truth.stanley import Steering, stanley_rad
from steerlab.sim.world import REACH_M

STEP_S = 0.05
LEAST_SPEED_MPS = 1.0
DRIVING, ARRIVED, TOUCHED = 0, 1, 2


@njit(cache=True)
def drive(
    points: FloatArray,
    heading: FloatArray,
    pose: tuple[float, float, float],
    steered_rad: float,
    speed_mps: float,
    seconds: float,
    ball: tuple[float, float],
    grid: DistanceGrid,
    body: Body,
    steering: Steering,
    keep: Keep,
) -> tuple[int, float, float]:
    """Follow a path with Stanley, limited in steering rate and lagged, at constant speed.

    Args:
        points: (n, 2) of the path.
        heading: (n,) of the path.
        pose: of the rear axle.
        steered_rad: where the road wheels stand at first.
        speed_mps: held throughout.
        seconds: the drive ends after that many,
        ball: or when the car's centre is within reach of the ball's,
        grid: or when a disc comes too near to a block or edge.
        body: the discs.
        steering: the law and its limits.
        keep: what "too near" means.

    Returns:
        ``DRIVING`` (time is over), ``ARRIVED`` or ``TOUCHED``; seconds driven; least spare
        clearance in metres.
    """
    x, y, bearing = pose
    delta, segment, spare_m = steered_rad, 0, np.inf
    steps = int(seconds / STEP_S)
    for step in range(steps):
        centre_x = x + 0.5 * steering.wheelbase_m * cos(bearing)
        centre_y = y + 0.5 * steering.wheelbase_m * sin(bearing)
        if hypot(centre_x - ball[0], centre_y - ball[1]) < REACH_M:
            return ARRIVED, step * STEP_S, spare_m
        along_m = step * STEP_S * speed_mps
        needed_m = needed_clearance_m(keep, along_m)
        spare_m = min(spare_m, clearance_at(grid, body, x, y, bearing) - needed_m)
        if spare_m < 0.0:
            return TOUCHED, step * STEP_S, spare_m
        wanted, segment = stanley_rad(points, heading, segment, x, y, bearing, speed_mps, steering)
        most = steering.rate_radps * STEP_S
        change = (wanted - delta) * min(STEP_S / steering.lag_s, 1.0)
        delta += min(max(change, -most), most)
        middle = bearing + 0.5 * STEP_S * speed_mps * tan(delta) / steering.wheelbase_m
        x += STEP_S * speed_mps * cos(middle)
        y += STEP_S * speed_mps * sin(middle)
        bearing += STEP_S * speed_mps * tan(delta) / steering.wheelbase_m
    return DRIVING, steps * STEP_S, spare_m


@njit(cache=True)
def spare_following(
    points: FloatArray,
    heading: FloatArray,
    pose: tuple[float, float, float],
    speed_mps: float,
    seconds: float,
    ball: tuple[float, float],
    grid: DistanceGrid,
    body: Body,
    steering: Steering,
    keep: Keep,
) -> float:
    """Least room to spare on a path; -1 m if the car touches something.

    A car that gets by only if its wheels already stand as Stanley asks has no room to spare. At
    standstill it is asked for a walking pace: what lies ahead matters there too.
    """
    speed_mps = max(speed_mps, LEAST_SPEED_MPS)
    outcome, _, spare_m = drive(
        points, heading, pose, 0.0, speed_mps, seconds, ball, grid, body, steering, keep
    )
    if outcome != TOUCHED:
        return spare_m
    x, y, bearing = pose
    steered_rad, _ = stanley_rad(points, heading, 0, x, y, bearing, speed_mps, steering)
    outcome, _, _ = drive(
        points, heading, pose, steered_rad, speed_mps, seconds, ball, grid, body, steering, keep
    )
    return -1.0 if outcome == TOUCHED else 0.0
