"""Stanley: the steering law that turns a path into a wheel position.

    delta = heading error + atan(k * e / (k_s + v))

with e the signed cross-track error of the front axle, positive when the path lies to the left.
Thrun et al., "Stanley: the robot that won the DARPA Grand Challenge", J. Field Robotics 23
(2006), eq. 5; the softening k_s is from Hoffmann et al., "Autonomous automobile trajectory
tracking for off-road driving", ACC 2007, eq. 10. The paper reads its ground truth off this law.
"""

from math import atan, atan2, cos, pi, sin
from typing import NamedTuple

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.config import PlannerConfig
from steerlab.sim.vehicle import CarConfig

SEARCH_M = 8.0  # how far along the path the front axle is looked for; less than half a turn


class Steering(NamedTuple):
    """What the law and the simulated steering need; a tuple, so that kernels can take it."""

    gain: float
    softening_mps: float
    full_lock_rad: float
    wheelbase_m: float
    rate_radps: float
    lag_s: float


def steering_of(car: CarConfig, config: PlannerConfig) -> Steering:
    """The steering of a car under a planner's settings."""
    return Steering(
        config.stanley_gain,
        config.stanley_softening_mps,
        car.full_lock_rad,
        car.wheelbase_m,
        config.steer_rate_radps,
        config.steer_lag_s,
    )


@njit(cache=True)
def wrap(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + pi) % (2.0 * pi) - pi


@njit(cache=True)
def project(
    points: FloatArray, heading: FloatArray, first: int, x_m: float, y_m: float
) -> tuple[int, float, float]:
    """The nearest spot of a path to a point, not before segment ``first``.

    The first and last segment are prolonged, and headings are interpolated along a segment.

    Returns:
        segment index, signed distance in metres (positive: the path lies to the left of a point
        facing along it), path heading there in radians.
    """
    last = points.shape[0] - 2
    best, segment, share, travelled = np.inf, first, 0.0, 0.0
    for i in range(first, last + 1):
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        squared = dx * dx + dy * dy
        if squared > 0.0:
            along = ((x_m - points[i, 0]) * dx + (y_m - points[i, 1]) * dy) / squared
            if i > 0:
                along = max(along, 0.0)
            if i < last:
                along = min(along, 1.0)
            off_x, off_y = points[i, 0] + along * dx - x_m, points[i, 1] + along * dy - y_m
            if off_x * off_x + off_y * off_y < best:
                best, segment, share = off_x * off_x + off_y * off_y, i, along
        travelled += np.sqrt(squared)
        if travelled > SEARCH_M and i > first:
            break
    dx = points[segment + 1, 0] - points[segment, 0]
    dy = points[segment + 1, 1] - points[segment, 1]
    off_x = points[segment, 0] + share * dx - x_m
    off_y = points[segment, 1] + share * dy - y_m
    direction = atan2(dy, dx)
    left_m = cos(direction) * off_y - sin(direction) * off_x
    side = 1.0 if left_m >= 0.0 else -1.0
    blend = min(max(share, 0.0), 1.0)
    bearing = heading[segment] + blend * wrap(heading[segment + 1] - heading[segment])
    return segment, side * np.sqrt(best), bearing


@njit(cache=True)
def stanley_rad(
    points: FloatArray,
    heading: FloatArray,
    first: int,
    x_m: float,
    y_m: float,
    heading_rad: float,
    speed_mps: float,
    steering: Steering,
) -> tuple[float, int]:
    """Road-wheel angle for a car whose *rear axle* is at (x, y), clipped at full lock.

    Returns:
        angle in radians (positive: left) and the segment the front axle is at.
    """
    front_x = x_m + steering.wheelbase_m * cos(heading_rad)
    front_y = y_m + steering.wheelbase_m * sin(heading_rad)
    segment, error_m, bearing = project(points, heading, first, front_x, front_y)
    speed_mps = max(speed_mps, 0.0)
    delta = wrap(bearing - heading_rad)
    delta += atan(steering.gain * error_m / (steering.softening_mps + speed_mps))
    return min(max(delta, -steering.full_lock_rad), steering.full_lock_rad), segment
