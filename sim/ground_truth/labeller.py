"""``Labeller``: tries, from the best to the last resort, to find the path a label is read from."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.bicycle import spare_following
from steerlab.sim.ground_truth.committed_path import chain_to_ball, curve
from steerlab.sim.ground_truth.distance_grid import Keep, clearance_at
from steerlab.sim.ground_truth.dubins_tree import PoseTree, join_tree
from steerlab.sim.ground_truth.label_path import MAX_POINTS, TOUCH_M, turn_and_go
from steerlab.sim.ground_truth.planner_inputs import RAMP_M, PlannerInputs, verified
from steerlab.sim.ground_truth.route import ANY_ROUTE, UNKNOWN_CORNER, Route
from steerlab.sim.ground_truth.rrt_star import PointTree, points_within

IntArray = NDArray[np.int64]

NEARBY_M = 15.0  # where nodes are tried when no corner can be turned to
JOIN_M = 30.0  # how far a curve may go before it meets the tree of poses
CORNER_RAD = 2.0  # sharper than this no shortest path turns at a corner
BEND_RAD = 0.6  # sharper than this the turn at a node should have been part of the first turn


class Labeller:
    """Holds the buffers the kernels write to, so one labeller serves one thread.

    ``points`` (n, 2) and ``heading`` (n,) are the path of the last successful ``find``.
    """

    def __init__(self, task: PlannerInputs, pose_tree: PoseTree) -> None:
        self._task = task
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
        tree = self._task.tree
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
            self._task,
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
        task, start = self._task, np.array(pose)
        grid, body = task.grid, task.body
        start_m = min(float(clearance_at(grid, body, *pose)) - TOUCH_M, body.radius_m)
        for radius_m, full_m in zip(task.radii_m, task.clearance_m, strict=True):
            keep = Keep(start_m, full_m, RAMP_M)
            _, node = join_tree(self._pose_tree, start, radius_m, JOIN_M, grid, body, keep)
            if node < 0:
                continue
            chain = chain_to_ball(self._pose_tree, start, node)
            points, heading = curve(chain, radius_m, task.radii_m[0], task.ball, task.path_step_m)
            spare_m = spare_following(
                points, heading, pose, speed_mps, task.verify_s, task.ball,
                grid, body, task.steering, verified(body, start_m),
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
    found = np.empty(2048, dtype=np.int64)
    return found[: points_within(tree.buckets, tree.points, x_m, y_m, radius_m, found)].copy()
