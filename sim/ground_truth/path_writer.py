"""Writes a turn, a straight and the way from a node to the ball as evenly spaced points."""

from math import atan2, cos, pi, sin, sqrt, tan

from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.rrt_star import PointTree

MAX_CUT_M = 0.4  # a rounded corner passes this much inside; square corners leave 0.6 m to spare
LEAST_LEG_M = 1e-6


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
