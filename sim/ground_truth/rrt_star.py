"""RRT* of a point, grown backward from the ball: the distance to the ball from anywhere.

Karaman & Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 30 (2011). The
paper plans afresh at every step of a rollout; one tree per world answers all of them, and does
not jump between routes.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import FloatArray, IntArray
from steerlab.sim.ground_truth.boxes import FreeSpace, free_corners, point_free, segment_free
from steerlab.sim.ground_truth.buckets import (
    Buckets,
    bucket_add,
    empty_buckets,
    nearest_point,
    points_within,
)

BUCKET_M = 2.0
MAX_RADIUS_M = 10.0
MAX_NEIGHBOURS = 512
STRING_PULLS = 3
MAX_DRAWS = 20  # of at least twice the points still missing


class PointTree(NamedTuple):
    """Nodes in the order they joined; node 0 is the ball.

    Attributes:
        points: (n, 2).
        cost_m: (n,) length of the path to the ball.
        parent: (n,) the next node on that path; -1 at the ball.
        corners: (k,) the ball and the nodes that are corners of grown blocks: where paths turn.
        buckets: of the points.
    """

    points: FloatArray
    cost_m: FloatArray
    parent: IntArray
    corners: IntArray
    buckets: Buckets


def grow_point_tree(
    space: FreeSpace, goal_xy_m: tuple[float, float], *, nodes: int, rng: np.random.Generator
) -> PointTree:
    """Grow a tree of ``nodes`` random samples, then the corners; the same rng gives the same tree.

    Samples that see nothing within reach are dropped, so the tree may hold fewer nodes.
    """
    low, high = space.bounds[[0, 2]], space.bounds[[1, 3]]
    samples = _draw_free(space, rng, low, high, nodes)
    corners = free_corners(space)
    area_m2 = float(np.prod(high - low))
    half_extent_m = float(np.abs(space.bounds).max())
    points, cost_m, parent, count, first_corner = _grow(
        space, np.array(goal_xy_m), samples, corners, area_m2, half_extent_m
    )
    points, cost_m, parent = points[:count], cost_m[:count], parent[:count]
    turning = np.concatenate(([0], np.arange(first_corner, count)))
    for _ in range(STRING_PULLS):
        _pull_strings(space, points, cost_m, parent, turning)
    buckets = empty_buckets(count, half_extent_m, BUCKET_M)
    for node in range(count):
        bucket_add(buckets, node, points[node, 0], points[node, 1])
    return PointTree(points, cost_m, parent, turning, buckets)


def _draw_free(
    space: FreeSpace, rng: np.random.Generator, low: FloatArray, high: FloatArray, count: int
) -> FloatArray:
    """(count, 2) uniform points of free space; fewer where there is hardly any."""
    drawn: list[FloatArray] = []
    missing = count
    for _ in range(MAX_DRAWS):
        batch = rng.uniform(low, high, size=(2 * missing + 16, 2))
        free = batch[_free_mask(space, batch)][:missing]
        drawn.append(free)
        missing -= len(free)
        if missing == 0:
            break
    return np.concatenate(drawn)


@njit(cache=True)
def _free_mask(space: FreeSpace, points: FloatArray) -> NDArray[np.bool_]:
    mask = np.empty(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        mask[i] = point_free(space, points[i, 0], points[i, 1])
    return mask


@njit(cache=True)
def _grow(
    space: FreeSpace,
    goal: FloatArray,
    samples: FloatArray,
    corners: FloatArray,
    area_m2: float,
    half_extent_m: float,
) -> tuple[FloatArray, FloatArray, IntArray, int, int]:
    """RRT*: connect each sample at the least cost, then rewire its neighbours through it.

    A stored cost is never below that of the parent plus the edge, so rewiring makes no cycle;
    ``_pull_strings`` brings the costs that became too large up to date.
    """
    capacity = 1 + samples.shape[0] + corners.shape[0]
    points, cost = np.empty((capacity, 2)), np.empty(capacity)
    parent = np.full(capacity, -1, dtype=np.int64)
    buckets = empty_buckets(capacity, half_extent_m, BUCKET_M)
    near = np.empty(MAX_NEIGHBOURS, dtype=np.int64)
    totals = np.empty(MAX_NEIGHBOURS)
    points[0], cost[0] = goal, 0.0
    bucket_add(buckets, 0, goal[0], goal[1])
    count, first_corner = 1, -1
    gamma = 2.0 * np.sqrt(1.5 * area_m2 / np.pi)  # Karaman & Frazzoli, Theorem 38, d = 2
    for s in range(samples.shape[0] + corners.shape[0]):
        if s < samples.shape[0]:
            x, y = samples[s, 0], samples[s, 1]
        else:
            x, y = corners[s - samples.shape[0], 0], corners[s - samples.shape[0], 1]
        if s == samples.shape[0]:
            first_corner = count
        radius = min(gamma * np.sqrt(np.log(count + 1.0) / (count + 1.0)), MAX_RADIUS_M)
        if s < samples.shape[0]:
            nearest = nearest_point(buckets, points, x, y)
            away = np.hypot(points[nearest, 0] - x, points[nearest, 1] - y)
            if away > radius:  # steer: come as near as the radius
                x = points[nearest, 0] + (x - points[nearest, 0]) * radius / away
                y = points[nearest, 1] + (y - points[nearest, 1]) * radius / away
                if not point_free(space, x, y):
                    continue
        near_count = points_within(buckets, points, x, y, radius + 1e-9, near)
        for k in range(near_count):
            node = near[k]
            totals[k] = cost[node] + np.hypot(points[node, 0] - x, points[node, 1] - y)
        chosen, best = -1, 0.0
        for k in np.argsort(totals[:near_count]):
            node = near[k]
            if segment_free(space, x, y, float(points[node, 0]), float(points[node, 1])):
                chosen, best = node, totals[k]
                break
        if chosen < 0:
            continue
        points[count, 0], points[count, 1] = x, y
        cost[count], parent[count] = best, chosen
        bucket_add(buckets, count, x, y)
        for k in range(near_count):
            node = near[k]
            through = best + np.hypot(points[node, 0] - x, points[node, 1] - y)
            if through < cost[node] - 1e-12 and segment_free(
                space, x, y, points[node, 0], points[node, 1]
            ):
                parent[node], cost[node] = count, through
        count += 1
    if first_corner < 0:
        first_corner = count
    return points, cost, parent, count, first_corner


@njit(cache=True)
def _pull_strings(
    space: FreeSpace, points: FloatArray, cost: FloatArray, parent: IntArray, corners: IntArray
) -> None:
    """From the ball outwards, link each node to the farthest ancestor it sees along its path.

    A corner is rewired with the whole world for its neighbourhood: random nodes beside it would
    otherwise stay in the way of far ones.
    """
    for node in np.argsort(cost, kind="mergesort"):
        if node == 0:
            continue
        x, y = points[node, 0], points[node, 1]
        chosen = parent[node]
        above = parent[chosen]
        while above >= 0 and segment_free(
            space, x, y, float(points[above, 0]), float(points[above, 1])
        ):
            chosen = above
            above = parent[chosen]
        best = cost[chosen] + np.hypot(points[chosen, 0] - x, points[chosen, 1] - y)
        for corner in corners:
            total = cost[corner] + np.hypot(points[corner, 0] - x, points[corner, 1] - y)
            if total < best - 1e-9 and segment_free(
                space, x, y, float(points[corner, 0]), float(points[corner, 1])
            ):
                chosen, best = corner, total
        parent[node], cost[node] = chosen, best


@njit(cache=True)
def cost_to_go(
    tree: PointTree, space: FreeSpace, x_m: float, y_m: float, radius_m: float
) -> tuple[float, int]:
    """Least cost from a point through a node within the radius, or through that node's parent.

    Returns:
        cost in metres and the first node of the path; (inf, -1) where no node is seen.
    """
    near = np.empty(MAX_NEIGHBOURS, dtype=np.int64)
    near_count = points_within(tree.buckets, tree.points, x_m, y_m, radius_m, near)
    best, chosen = np.inf, -1
    for k in range(2 * near_count):
        node = near[k % near_count]
        if k < near_count:
            node = tree.parent[node]  # parents first: they make most direct tests needless
            if node < 0:
                continue
        total = tree.cost_m[node] + np.hypot(tree.points[node, 0] - x_m, tree.points[node, 1] - y_m)
        if total < best and segment_free(
            space, x_m, y_m, float(tree.points[node, 0]), float(tree.points[node, 1])
        ):
            best, chosen = total, node
    return float(best), int(chosen)
