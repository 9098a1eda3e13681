"""From a chain of poses to a smooth committed path: sample its Dubins curves, then shorten it."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.distance_grid import Body, DistanceGrid, Keep
from steerlab.sim.ground_truth.dubins import dubins_pose, shortest_dubins
from steerlab.sim.ground_truth.dubins_tree import PoseTree, edge_free
from steerlab.sim.ground_truth.path_writer import write_straight

SHORTCUT_STEP_M = 2.0  # between the poses a shortcut may join
SHORTCUT_PASSES = 2
BEYOND_GOAL_M = 20.0  # more than a goal pose lies before the ball


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
