"""Writes paths as evenly spaced points.

A label's path is a turn, a straight and the way from a node to the ball. A committed path follows
the Dubins curves of a chain of poses, once that chain is shortened.
"""

from math import atan2, cos, pi, sin, sqrt, tan

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.distance_grid import Body, DistanceGrid, Keep
from steerlab.sim.ground_truth.dubins import dubins_pose, shortest_dubins
from steerlab.sim.ground_truth.dubins_tree import PoseTree, edge_free
from steerlab.sim.ground_truth.rrt_star import PointTree

MAX_CUT_M = 0.4  # a rounded corner passes this much inside; square corners leave 0.6 m to spare
LEAST_LEG_M = 1e-6
SHORTCUT_STEP_M = 2.0  # between the poses a shortcut may join
SHORTCUT_PASSES = 2
BEYOND_GOAL_M = 20.0  # more than a goal pose lies before the ball


@njit(cache=True)
def write_turn(
    pose: tuple[float, float, float], turn_rad: float, radius_m: float, step_m: float,
    points: FloatArray, heading: FloatArray,
) -> int:  # fmt: skip
    """Write an arc from a pose (positive: left), both ends included; returns the rows written."""
    x, y, bearing = pose
    side = 1.0 if turn_rad >= 0.0 else -1.0
    steps = int(radius_m * abs(turn_rad) / step_m) + 1
    for k in range(steps + 1):
        angle = bearing + turn_rad * k / steps
        points[k, 0] = x + side * radius_m * (sin(angle) - sin(bearing))
        points[k, 1] = y - side * radius_m * (cos(angle) - cos(bearing))
        heading[k] = angle
    return steps + 1


@njit(cache=True)
def write_straight(
    to_x: float, to_y: float, step_m: float, row: int, points: FloatArray, heading: FloatArray
) -> int:
    """Append a straight from the last row to a point, as far as the buffers reach."""
    ax, ay = points[row - 1, 0], points[row - 1, 1]
    length_m = sqrt((to_x - ax) ** 2 + (to_y - ay) ** 2)
    if length_m < LEAST_LEG_M:
        return row
    bearing = heading[row - 1] + _wrap(atan2(to_y - ay, to_x - ax) - heading[row - 1])
    steps = int(length_m / step_m) + 1
    for k in range(1, steps + 1):
        if row == points.shape[0]:
            break
        points[row, 0] = ax + (to_x - ax) * k / steps
        points[row, 1] = ay + (to_y - ay) * k / steps
        heading[row] = bearing
        row += 1
    return row


@njit(cache=True)
def write_way(
    tree: PointTree, node: int, radius_m: float, step_m: float, row: int,
    points: FloatArray, heading: FloatArray,
) -> int:  # fmt: skip
    """Append the way from the last row over ``node`` to the ball, its corners rounded.

    A corner is rounded at the planned radius, or tighter where that would cut it by more than
    ``MAX_CUT_M``; so the wheel turns a little before the corner, as a driver's would.
    """
    while node >= 0 and row < points.shape[0]:
        corner, onward = tree.points[node], tree.parent[node]
        if onward < 0:
            return write_straight(corner[0], corner[1], step_m, row, points, heading)
        here, beyond = points[row - 1].copy(), tree.points[onward]
        in_m = sqrt((corner[0] - here[0]) ** 2 + (corner[1] - here[1]) ** 2)
        out_m = sqrt((beyond[0] - corner[0]) ** 2 + (beyond[1] - corner[1]) ** 2)
        before = atan2(corner[1] - here[1], corner[0] - here[0])
        after = atan2(beyond[1] - corner[1], beyond[0] - corner[0])
        bend = _wrap(after - before)
        half = tan(0.5 * abs(bend))
        if in_m > LEAST_LEG_M and out_m > LEAST_LEG_M and 1e-3 < abs(bend) < 0.9 * pi:
            arc_m = min(radius_m, MAX_CUT_M / (1.0 / cos(0.5 * bend) - 1.0))
            room_m = min(arc_m * half, in_m, 0.5 * out_m)
            arc_m = room_m / half
            row = write_straight(
                corner[0] - room_m * cos(before), corner[1] - room_m * sin(before),
                step_m, row, points, heading,
            )  # fmt: skip
            row = _write_bend(
                corner[0], corner[1], room_m, arc_m, before, bend, step_m, row, points, heading
            )
        else:
            row = write_straight(corner[0], corner[1], step_m, row, points, heading)
        node = onward
    return row


@njit(cache=True)
def _write_bend(
    x: float, y: float, room_m: float, arc_m: float, before: float, bend: float, step_m: float,
    row: int, points: FloatArray, heading: FloatArray,
) -> int:  # fmt: skip
    """Append the arc that rounds the corner (x, y), without its first point."""
    side = 1.0 if bend >= 0.0 else -1.0
    start_x, start_y = x - room_m * cos(before), y - room_m * sin(before)
    steps = int(arc_m * abs(bend) / step_m) + 2
    first = heading[row - 1] + _wrap(before - heading[row - 1])
    for k in range(1, steps + 1):
        if row == points.shape[0]:
            break
        angle = before + bend * k / steps
        points[row, 0] = start_x + side * arc_m * (sin(angle) - sin(before))
        points[row, 1] = start_y - side * arc_m * (cos(angle) - cos(before))
        heading[row] = first + bend * k / steps
        row += 1
    return row


@njit(cache=True)
def _wrap(angle_rad: float) -> float:
    return (angle_rad + pi) % (2.0 * pi) - pi


def chain_to_ball(tree: PoseTree, pose: FloatArray, node: int) -> FloatArray:
    """(n, 3) poses from ``pose`` over ``node`` to a goal pose."""
    chain = [pose]
    while node >= 0:
        chain.append(tree.poses[node])
        node = int(tree.parent[node])
    return np.array(chain)


def shorten(
    chain: FloatArray, radius_m: float, grid: DistanceGrid, body: Body, keep: Keep
) -> FloatArray:
    """A shorter chain (n, 3) with the same ends, over poses of the curve itself."""
    for _ in range(SHORTCUT_PASSES):
        poses = sample_chain(chain, radius_m, SHORTCUT_STEP_M)
        chain = poses[_shortest_chain(poses, radius_m, grid, body, keep)]
    return chain


def curve(
    chain: FloatArray,
    first_radius_m: float,
    radius_m: float,
    ball_xy_m: tuple[float, float],
    step_m: float,
) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and headings (n,) along a chain of poses and on to the ball.

    The turning radius is ``first_radius_m`` from the first pose to the second, then ``radius_m``.
    """
    first = sample_chain(chain[:2], first_radius_m, step_m)
    rest = sample_chain(chain[1:], radius_m, step_m)
    poses = np.concatenate((first[:-1], rest))
    rows = len(poses) + int(BEYOND_GOAL_M / step_m)
    points, heading = np.empty((rows, 2)), np.empty(rows)
    points[: len(poses)], heading[: len(poses)] = poses[:, :2], np.unwrap(poses[:, 2])
    length = write_straight(*ball_xy_m, step_m, len(poses), points, heading)
    return points[:length], heading[:length]


@njit(cache=True)
def sample_chain(chain: FloatArray, radius_m: float, step_m: float) -> FloatArray:
    """(n, 3) poses at most ``step_m`` apart along the Dubins curves between a chain's poses.

    The chain's own poses are among them, bit for bit.
    """
    total = 1
    for i in range(chain.shape[0] - 1):
        a, b = chain[i], chain[i + 1]
        _, t, p, q = shortest_dubins(a[0], a[1], a[2], b[0], b[1], b[2], radius_m)
        total += max(int(np.ceil((t + p + q) * radius_m / step_m)), 1)
    poses = np.empty((total, 3))
    row = 0
    for i in range(chain.shape[0] - 1):
        a, b = chain[i], chain[i + 1]
        word, t, p, q = shortest_dubins(a[0], a[1], a[2], b[0], b[1], b[2], radius_m)
        length_m = (t + p + q) * radius_m
        steps = max(int(np.ceil(length_m / step_m)), 1)
        for k in range(steps):
            poses[row] = dubins_pose(
                a[0], a[1], a[2], word, t, p, q, radius_m, length_m * k / steps
            )
            row += 1
    poses[row] = chain[-1]
    return poses


@njit(cache=True)
def _shortest_chain(
    poses: FloatArray, radius_m: float, grid: DistanceGrid, body: Body,
    keep: Keep,
) -> NDArray[np.int64]:  # fmt: skip
    """Indices of the poses that the shortest drivable chain of Dubins curves goes over.

    Neighbours are joined as they were; the first pose's edges use the whole ramp of ``keep``.
    """
    count = poses.shape[0]
    cost = np.full(count, np.inf)
    following = np.full(count, -1, dtype=np.int64)
    cost[count - 1] = 0.0
    for i in range(count - 2, -1, -1):
        from_here = keep if i == 0 else Keep(keep.full_m, keep.full_m, keep.ramp_m)
        a = poses[i]
        for j in range(i + 1, count):
            b = poses[j]
            if np.hypot(b[0] - a[0], b[1] - a[1]) + cost[j] >= cost[i]:
                continue
            word, t, p, q = shortest_dubins(a[0], a[1], a[2], b[0], b[1], b[2], radius_m)
            total = (t + p + q) * radius_m + cost[j]
            if total < cost[i] - 1e-6 and (
                j == i + 1 or edge_free(a, word, t, p, q, radius_m, grid, body, from_here)
            ):
                cost[i], following[i] = total, j
    kept = np.empty(count, dtype=np.int64)
    kept[0], length = 0, 1
    while following[kept[length - 1]] >= 0:
        kept[length] = following[kept[length - 1]]
        length += 1
    return kept[:length]
