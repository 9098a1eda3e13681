"""RRT* over poses with Dubins edges, grown backward from the ball: what can really be driven.

Karaman & Frazzoli, "Sampling-based optimal motion planning for non-holonomic dynamical systems",
ICRA 2013. All poses are those of the rear axle, which is the point of a car that follows a
Dubins curve exactly.
"""

from math import atan2
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray, IntArray
from steerlab.sim.ground_truth.boxes import FreeSpace
from steerlab.sim.ground_truth.buckets import (
    Buckets,
    bucket_add,
    empty_buckets,
    points_within,
)
from steerlab.sim.ground_truth.distance_grid import (
    Body,
    DistanceGrid,
    Keep,
    clearance_at,
    needed_clearance_m,
)
from steerlab.sim.ground_truth.dubins import dubins_pose, shortest_dubins
from steerlab.sim.ground_truth.rrt_star import PointTree, cost_to_go
from steerlab.sim.world import REACH_M

STAND_OFF_M = REACH_M - 0.5  # car's centre to ball's centre at the goal poses: surely in reach
BUCKET_M = 4.0
MAX_RADIUS_M = 25.0
RADIUS_GAMMA_M = 70.0  # times (log n / n)^(1/3): about 100 neighbours at 3000 nodes
LEAST_STEP_M = 0.2  # of a collision check
SWING = 1.15  # a disc moves at most this much faster than the rear axle on a planned turn
MAX_DRAWS = 20  # of as many poses as the tree is to have
GUIDED_SHARE = 0.6  # of the samples head roughly along the shortest path of a point
GUIDED_SPREAD_RAD = 0.5


class PoseTree(NamedTuple):
    """Nodes in the order they joined; the first ``goals`` are goal poses.

    Attributes:
        poses: (n, 3) x_m, y_m, heading_rad of the rear axle.
        cost_m: (n,) length of the path to the ball's centre.
        parent: (n,) the next node; -1 at goal poses.
        buckets: of the positions.
    """

    poses: FloatArray
    cost_m: FloatArray
    parent: IntArray
    goals: int
    buckets: Buckets


def goal_poses(
    ball_xy_m: tuple[float, float], count: int, body: Body, grid: DistanceGrid, needed_m: float
) -> FloatArray:
    """(n, 3) clear rear-axle poses facing the ball from ``count`` directions, just within reach."""
    behind_m = STAND_OFF_M + body.wheelbase_m / 2.0
    angles = 2.0 * np.pi * np.arange(count) / count
    poses = np.stack(
        (
            ball_xy_m[0] - behind_m * np.cos(angles),
            ball_xy_m[1] - behind_m * np.sin(angles),
            angles,
        ),
        axis=-1,
    )
    clear = [clearance_at(grid, body, *pose) >= needed_m for pose in poses.tolist()]
    return np.ascontiguousarray(poses[np.array(clear, dtype=bool)])


def grow_pose_tree(
    goals: FloatArray,
    grid: DistanceGrid,
    body: Body,
    point_tree: PointTree,
    space: FreeSpace,
    *,
    nodes: int,
    radius_m: float,
    needed_m: float,
    rng: np.random.Generator,
) -> PoseTree:
    """Grow a tree of up to ``nodes`` samples; the same rng gives the same tree.

    The edges turn at ``radius_m``, and the discs' centres keep ``needed_m`` along them.
    """
    samples = np.empty((0, 3))
    for _ in range(MAX_DRAWS if len(goals) else 0):
        xy = rng.uniform(-grid.half_extent_m, grid.half_extent_m, size=(nodes, 2))
        guided = rng.random(nodes) < GUIDED_SHARE
        noise = rng.normal(0.0, GUIDED_SPREAD_RAD, size=nodes)
        unguided = rng.uniform(-np.pi, np.pi, size=nodes)
        drawn, clear = _headings(
            xy, guided, noise, unguided, grid, body, point_tree, space, needed_m
        )
        samples = np.concatenate((samples, drawn[clear]))
        if len(samples) >= nodes:
            break
    poses, cost_m, parent, count = _grow(goals, samples[:nodes], grid, body, radius_m, needed_m)
    buckets = empty_buckets(max(count, 1), grid.half_extent_m, BUCKET_M)
    for node in range(count):
        bucket_add(buckets, node, poses[node, 0], poses[node, 1])
    return PoseTree(poses[:count], cost_m[:count], parent[:count], len(goals), buckets)


@njit(cache=True)
def _headings(
    xy: FloatArray, guided: NDArray[np.bool_], noise: FloatArray, unguided: FloatArray,
    grid: DistanceGrid, body: Body, point_tree: PointTree, space: FreeSpace, needed_m: float,
) -> tuple[FloatArray, NDArray[np.bool_]]:  # fmt: skip
    """Complete positions to poses (n, 3), and tell which are clear."""
    poses = np.empty((xy.shape[0], 3))
    clear = np.empty(xy.shape[0], dtype=np.bool_)
    for i in range(xy.shape[0]):
        x, y, heading = xy[i, 0], xy[i, 1], unguided[i]
        if guided[i]:
            _, node = cost_to_go(point_tree, space, x, y, 3.0)
            if node >= 0:
                to = point_tree.points[node]
                heading = atan2(to[1] - y, to[0] - x) + noise[i]
        poses[i, 0], poses[i, 1], poses[i, 2] = x, y, heading
        clear[i] = clearance_at(grid, body, x, y, heading) >= needed_m
    return poses, clear


@njit(cache=True)
def edge_free(
    a: FloatArray, word: int, t: float, p: float, q: float, radius_m: float,
    grid: DistanceGrid, body: Body, keep: Keep,
) -> bool:  # fmt: skip
    """Whether the car keeps its clearance along a Dubins curve from pose a."""
    length_m = (t + p + q) * radius_m
    along_m = 0.0
    while True:
        x, y, heading = dubins_pose(a[0], a[1], a[2], word, t, p, q, radius_m, along_m)
        needed_m = needed_clearance_m(keep, along_m)
        spare_m = clearance_at(grid, body, x, y, heading) - needed_m
        if spare_m < 0.0:
            return False
        if along_m >= length_m:
            return True
        # the ramp rises while the car moves, so only part of the spare room may be leapt over
        along_m = min(along_m + max(LEAST_STEP_M, 0.8 * spare_m / SWING), length_m)


@njit(cache=True)
def _grow(
    goals: FloatArray, samples: FloatArray, grid: DistanceGrid, body: Body,
    radius_m: float, needed_m: float,
) -> tuple[FloatArray, FloatArray, IntArray, int]:  # fmt: skip
    """RRT* with edges that lead from a new node to the tree; what fails to connect is retried."""
    capacity = goals.shape[0] + samples.shape[0]
    poses, cost = np.empty((capacity, 3)), np.empty(capacity)
    edge, parent = np.zeros(capacity), np.full(capacity, -1, dtype=np.int64)
    buckets = empty_buckets(max(capacity, 1), grid.half_extent_m, BUCKET_M)
    near, totals = np.empty(1024, dtype=np.int64), np.empty(1024)
    count = goals.shape[0]
    for i in range(count):
        poses[i], cost[i] = goals[i], STAND_OFF_M + body.wheelbase_m / 2.0
        bucket_add(buckets, i, goals[i, 0], goals[i, 1])
    keep = Keep(needed_m, needed_m, 1.0)
    joined = np.zeros(samples.shape[0], dtype=np.bool_)
    for s in range(2 * samples.shape[0]):
        s %= samples.shape[0]
        if joined[s] or count == 0:
            continue
        new = samples[s]
        shrink = (np.log(count + 1.0) / (count + 1.0)) ** (1.0 / 3.0)
        reach_m = min(RADIUS_GAMMA_M * shrink, MAX_RADIUS_M)
        near_count = points_within(buckets, poses, new[0], new[1], reach_m, near)
        for k in range(near_count):
            to = poses[near[k]]
            _, t, p, q = shortest_dubins(new[0], new[1], new[2], to[0], to[1], to[2], radius_m)
            totals[k] = cost[near[k]] + (t + p + q) * radius_m
        for k in np.argsort(totals[:near_count]):
            to = poses[near[k]]
            word, t, p, q = shortest_dubins(new[0], new[1], new[2], to[0], to[1], to[2], radius_m)
            if edge_free(new, word, t, p, q, radius_m, grid, body, keep):
                poses[count], cost[count], parent[count] = new, totals[k], near[k]
                edge[count] = (t + p + q) * radius_m
                joined[s] = True
                break
        if not joined[s]:
            continue
        bucket_add(buckets, count, new[0], new[1])
        for k in range(near_count):
            node = near[k]
            if node < goals.shape[0]:
                continue
            at = poses[node]
            if cost[count] + np.hypot(at[0] - new[0], at[1] - new[1]) >= cost[node]:
                continue
            word, t, p, q = shortest_dubins(at[0], at[1], at[2], new[0], new[1], new[2], radius_m)
            through = cost[count] + (t + p + q) * radius_m
            if through < cost[node] - 1e-9 and edge_free(
                at, word, t, p, q, radius_m, grid, body, keep
            ):
                parent[node], cost[node], edge[node] = count, through, (t + p + q) * radius_m
        count += 1
    for node in np.argsort(cost[:count], kind="mergesort"):  # rewiring left some costs too large
        if parent[node] >= 0:
            cost[node] = cost[parent[node]] + edge[node]
    return poses, cost, parent, count


@njit(cache=True)
def join_tree(
    tree: PoseTree, pose: FloatArray, radius_m: float, reach_m: float,
    grid: DistanceGrid, body: Body, keep: Keep,
) -> tuple[float, int]:  # fmt: skip
    """The node within ``reach_m`` through which a pose gets to the ball at the least cost.

    Returns:
        cost in metres and the node; (inf, -1) where none can be driven to.
    """
    best, chosen = np.inf, -1
    for node in range(tree.poses.shape[0]):
        to = tree.poses[node]
        away_m = np.hypot(to[0] - pose[0], to[1] - pose[1])
        if away_m > reach_m or away_m + tree.cost_m[node] >= best:
            continue
        word, t, p, q = shortest_dubins(pose[0], pose[1], pose[2], to[0], to[1], to[2], radius_m)
        total = (t + p + q) * radius_m + tree.cost_m[node]
        if total < best and edge_free(pose, word, t, p, q, radius_m, grid, body, keep):
            best, chosen = total, node
    return best, chosen
