"""The path a label is read from: turn, then straight to the best node of the point tree.

A fresh random tree at each step, as in the paper, jumps between routes. Here the first turn is
exact and everything after it comes from one field of distances, so that the path, and with it
the label, changes as smoothly as the car's pose.
"""

from math import acos, atan2, cos, pi, sin, sqrt

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray, IntArray
from steerlab.sim.ground_truth.bicycle import spare_following
from steerlab.sim.ground_truth.distance_grid import (
    Keep,
    clearance_at,
    distance_at,
    needed_clearance_m,
)
from steerlab.sim.ground_truth.dubins import turn_angle
from steerlab.sim.ground_truth.dubins_tree import PoseTree, join_tree
from steerlab.sim.ground_truth.path_writer import chain_to_ball, curve, write_turn, write_way
from steerlab.sim.ground_truth.planner_inputs import (
    ANY_ROUTE,
    DRIVE_SLACK_M,
    RAMP_M,
    UNKNOWN_CORNER,
    PlannerInputs,
    Route,
    same_route,
    verified,
)
from steerlab.sim.ground_truth.rrt_star import PointTree, points_within
from steerlab.sim.world import REACH_M

LEAST_STEP_M = 0.2  # of a collision check
BLOCKED = np.inf
MAX_POINTS = 2048
MOST_DRIVES = 3  # candidates of each side and radius driven in simulation before giving up
MOST_LOOKS = 256  # at candidates before giving up
TOUCH_M = 0.1  # a car too near a block may come this much nearer: discs are wider than it is
SQUEEZE_COST = 10.0  # metres of detour worth one metre inside the margin
GRAZE_COST = 100.0  # metres of detour worth one metre that discs overlap a block on the drive
LOOKED_AT, DRIVEN = 1, 2  # what has been done with a candidate
NEARBY_M = 15.0  # where nodes are tried when no corner can be turned to
JOIN_M = 30.0  # how far a curve may go before it meets the tree of poses
CORNER_RAD = 2.0  # sharper than this no shortest path turns at a corner
BEND_RAD = 0.6  # sharper than this the turn at a node should have been part of the first turn


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
def free_turns(
    inputs: PlannerInputs, pose: tuple[float, float, float], start_m: float
) -> FloatArray:
    """(4,) how far the car can turn left, right, and the same at the tight radius, in radians."""
    x, y, bearing = pose
    free = np.empty(4)
    for kind in range(4):
        side, radius_m = (1.0 if kind % 2 == 0 else -1.0), inputs.radii_m[kind // 2]
        keep = Keep(start_m, inputs.clearance_m[kind // 2], RAMP_M)
        free[kind], turn = 0.0, 0.0
        while turn < 2.0 * pi:
            angle = bearing + side * turn
            at_x = x + side * radius_m * (sin(angle) - sin(bearing))
            at_y = y - side * radius_m * (cos(angle) - cos(bearing))
            needed_m = needed_clearance_m(keep, radius_m * turn)
            spare_m = clearance_at(inputs.grid, inputs.body, at_x, at_y, angle) - needed_m
            if spare_m < 0.0:
                break
            free[kind] = turn
            turn += max(LEAST_STEP_M, 0.7 * spare_m) / radius_m
    return free


@njit(cache=True)
def squeeze(
    inputs: PlannerInputs, pose: tuple[float, float, float], turn: float, radius_m: float,
    node: int, keep: Keep,
) -> float:  # fmt: skip
    """How far the straight after a turn enters the grown blocks; infinite if the car must touch.

    Square distances are what the tree's costs are built on: held to them, a straight past a
    corner appears just when the car has it abreast, and the label does not jump.
    """
    x, y, bearing = pose
    side, turn_m, angle = (1.0 if turn >= 0.0 else -1.0), radius_m * abs(turn), bearing + turn
    at_x = x + side * radius_m * (sin(angle) - sin(bearing))
    at_y = y - side * radius_m * (cos(angle) - cos(bearing))
    to = inputs.tree.points[node]
    straight_m = sqrt((to[0] - at_x) ** 2 + (to[1] - at_y) ** 2)
    if node == 0:  # the drive is over once the car's centre is within reach of the ball
        straight_m -= REACH_M
    now_m = min(distance_at(inputs.square_grid, x, y), inputs.grown_m)
    keep_square = Keep(now_m, inputs.grown_m, keep.ramp_m)
    squeeze_m, ahead_m = 0.0, 0.0
    while ahead_m < straight_m:
        on_x, on_y = at_x + ahead_m * cos(angle), at_y + ahead_m * sin(angle)
        needed_m = needed_clearance_m(keep, turn_m + ahead_m)
        if distance_at(inputs.grid, on_x, on_y) < needed_m:
            return BLOCKED
        wanted_m = needed_clearance_m(keep_square, turn_m + ahead_m)
        spare_m = distance_at(inputs.square_grid, on_x, on_y) - wanted_m
        squeeze_m = max(squeeze_m, -spare_m)
        ahead_m += max(LEAST_STEP_M, 0.7 * spare_m)
    return squeeze_m


@njit(cache=True)
def turn_and_go(
    inputs: PlannerInputs, pose: tuple[float, float, float], speed_mps: float, nodes: IntArray,
    max_kink_rad: float, before: Route, remembers: bool, points: FloatArray, heading: FloatArray,
) -> tuple[int, Route]:  # fmt: skip
    """Find the cheapest drivable turn-and-straight onto one of ``nodes``, and write its path.

    Candidates are every node, left and right, at both radii. The cheapest is looked at, then
    driven in simulation, and goes back among the others if that raised its cost.

    Args:
        inputs: the world and the car.
        pose: of the rear axle.
        speed_mps: at which the path must be drivable.
        nodes: (n,) candidates of ``inputs.tree``.
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
    start_m = min(clearance_at(inputs.grid, inputs.body, *pose) - TOUCH_M, inputs.body.radius_m)
    free_rad = free_turns(inputs, pose, start_m)
    cost, turns = _candidates(inputs, pose, nodes, max_kink_rad, before, remembers, free_rad)
    steps_done = np.zeros(cost.shape[0], dtype=np.int64)
    drives = np.zeros(4, dtype=np.int64)
    for _ in range(MOST_LOOKS):
        k = int(np.argmin(cost))
        if cost[k] == BLOCKED:
            break
        node, kind, tight = int(nodes[k % count]), k // count, k // (2 * count)
        radius_m = inputs.radii_m[tight]
        steps_done[k] += 1
        if steps_done[k] == LOOKED_AT:
            keep = Keep(start_m, inputs.clearance_m[tight], RAMP_M)
            cost[k] += SQUEEZE_COST * squeeze(inputs, pose, turns[k], radius_m, node, keep)
            continue
        row = write_turn(pose, turns[k], radius_m, inputs.path_step_m, points, heading)
        length = write_way(
            inputs.tree, node, inputs.radii_m[0], inputs.path_step_m, row, points, heading
        )
        if steps_done[k] > DRIVEN:
            return length, Route(turns[k], int(inputs.routes.corner_of[node]))
        drives[kind] += 1
        spare_m = -1.0
        if drives[kind] <= MOST_DRIVES:
            spare_m = spare_following(
                points[:length], heading[:length], pose, speed_mps, inputs.verify_s, inputs.ball,
                inputs.grid, inputs.body, inputs.steering, verified(inputs.body, start_m),
            )  # fmt: skip
        if spare_m < 0.0:
            cost[k] = BLOCKED
        else:
            cost[k] += GRAZE_COST * max(DRIVE_SLACK_M - spare_m, 0.0)
    return 0, before


@njit(cache=True)
def _candidates(
    inputs: PlannerInputs, pose: tuple[float, float, float], nodes: IntArray, max_kink_rad: float,
    before: Route, remembers: bool, free_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """(4 n,) costs in metres and signed turns: left, right, then the same at the tight radius."""
    x, y, bearing = pose
    tree, count = inputs.tree, nodes.shape[0]
    cost, turns = np.full(4 * count, BLOCKED), np.zeros(4 * count)
    for k in range(4 * count):
        tight, node = k // (2 * count), int(nodes[k % count])
        side = 1.0 if (k // count) % 2 == 0 else -1.0
        to, radius_m = tree.points[node], inputs.radii_m[tight]
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
        cost[k] = inputs.radii_m[0] * turn + straight_m + tree.cost_m[node] + inputs.extra_m[tight]
        if remembers and not same_route(inputs.routes, before, turns[k], node):
            cost[k] += inputs.hysteresis_m
    return cost, turns


class Labeller:
    """Finds label paths; it holds the buffers the kernels write to, so one serves one thread.

    ``points`` (n, 2) and ``heading`` (n,) are the path of the last successful ``find``.
    """

    def __init__(self, inputs: PlannerInputs, pose_tree: PoseTree) -> None:
        self._inputs = inputs
        self._pose_tree = pose_tree
        self._points = np.empty((MAX_POINTS, 2))
        self._heading = np.empty(MAX_POINTS)
        self.points = self._points[:0]
        self.heading = self._heading[:0]

    def find(
        self, pose: tuple[float, float, float], speed_mps: float, before: Route | None
    ) -> Route | None:
        """The path for a rear axle at ``pose``; None if nothing can be driven.

        First a turn onto a corner, then onto a nearby node, then into the tree of poses.
        """
        tree = self._inputs.tree
        route = self._turn(pose, speed_mps, before, tree.corners, CORNER_RAD)
        if route is None:
            nearby = _nodes_near(tree, pose[0], pose[1], NEARBY_M)
            route = self._turn(pose, speed_mps, before, nearby, BEND_RAD)
        if route is None:
            route = self._join_tree(pose, speed_mps)
        return route

    def _turn(
        self,
        pose: tuple[float, float, float],
        speed_mps: float,
        before: Route | None,
        nodes: IntArray,
        max_kink_rad: float,
    ) -> Route | None:
        length, route = turn_and_go(
            self._inputs,
            pose,
            speed_mps,
            nodes,
            max_kink_rad,
            before or ANY_ROUTE,
            before is not None,
            self._points,
            self._heading,
        )
        if not length:
            return None
        self.points, self.heading = self._points[:length], self._heading[:length]
        return route

    def _join_tree(self, pose: tuple[float, float, float], speed_mps: float) -> Route | None:
        inputs, start = self._inputs, np.array(pose)
        grid, body = inputs.grid, inputs.body
        start_m = min(float(clearance_at(grid, body, *pose)) - TOUCH_M, body.radius_m)
        for radius_m, full_m in zip(inputs.radii_m, inputs.clearance_m, strict=True):
            keep = Keep(start_m, full_m, RAMP_M)
            _, node = join_tree(self._pose_tree, start, radius_m, JOIN_M, grid, body, keep)
            if node < 0:
                continue
            chain = chain_to_ball(self._pose_tree, start, node)
            points, heading = curve(
                chain, radius_m, inputs.radii_m[0], inputs.ball, inputs.path_step_m
            )
            spare_m = spare_following(
                points, heading, pose, speed_mps, inputs.verify_s, inputs.ball,
                grid, body, inputs.steering, verified(body, start_m),
            )  # fmt: skip
            if spare_m >= 0.0:
                self.points, self.heading = points, heading
                return Route(_first_turn(heading), UNKNOWN_CORNER)
        return None


def _first_turn(heading: FloatArray) -> float:
    """Heading gained until a path first stops turning the way it began, positive left."""
    steps = np.diff(heading)
    turning = np.flatnonzero(np.abs(steps) > 1e-9)
    if not len(turning):
        return 0.0
    other_way = np.flatnonzero(steps * steps[turning[0]] < -1e-12)
    return float(heading[other_way[0]] if len(other_way) else heading[-1]) - float(heading[0])


@njit(cache=True)
def _nodes_near(tree: PointTree, x_m: float, y_m: float, radius_m: float) -> IntArray:
    nodes = np.empty(2048, dtype=np.int64)
    return nodes[: points_within(tree.buckets, tree.points, x_m, y_m, radius_m, nodes)].copy()
