"""Exact shortest paths of a point among grown blocks: the oracle RRT* is tested against.

In a polygonal free space a shortest path turns only at corners (de Berg et al., *Computational
Geometry*, 3rd ed., ch. 15), so Dijkstra over mutually visible corners finds it.
"""

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.ground_truth.boxes import FreeSpace, free_corners, point_free, segment_free


class VisibilityGraph:
    """Exact cost-to-go to one goal.

    Attributes:
        nodes: (n, 2) the goal, then the free corners.
        cost_m: (n,) distance to the goal; infinite where none leads there.
    """

    def __init__(self, space: FreeSpace, goal_xy_m: tuple[float, float]) -> None:
        self.space = space
        self.nodes: FloatArray = np.concatenate((np.array([goal_xy_m]), free_corners(space)))
        self.cost_m: FloatArray = _dijkstra(_edge_lengths(space, self.nodes))

    def cost_to_go_m(self, x_m: float, y_m: float) -> float:
        """Length of the shortest path from a point; infinite from inside a box or a closed room."""
        if not point_free(self.space, x_m, y_m):
            return float("inf")
        return _best(self.space, self.nodes, self.cost_m, x_m, y_m)


@njit(cache=True)
def _edge_lengths(space: FreeSpace, nodes: FloatArray) -> FloatArray:
    """(n, n) length of each free edge, infinite where a box is in the way."""
    count = nodes.shape[0]
    lengths = np.full((count, count), np.inf)
    for i in range(count):
        for j in range(i):
            if segment_free(space, nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]):
                lengths[i, j] = np.hypot(nodes[i, 0] - nodes[j, 0], nodes[i, 1] - nodes[j, 1])
                lengths[j, i] = lengths[i, j]
    return lengths


@njit(cache=True)
def _dijkstra(lengths: FloatArray) -> FloatArray:
    """(n,) shortest distance of each node to node 0."""
    count = lengths.shape[0]
    cost = np.full(count, np.inf)
    cost[0] = 0.0
    done = np.zeros(count, dtype=np.bool_)
    for _ in range(count):
        nearest = -1
        for i in range(count):
            if not done[i] and cost[i] < np.inf and (nearest < 0 or cost[i] < cost[nearest]):
                nearest = i
        if nearest < 0:
            break
        done[nearest] = True
        for i in range(count):
            cost[i] = min(cost[i], cost[nearest] + lengths[nearest, i])
    return cost


@njit(cache=True)
def _best(space: FreeSpace, nodes: FloatArray, cost: FloatArray, x_m: float, y_m: float) -> float:
    best = np.inf
    for i in range(nodes.shape[0]):
        total = cost[i] + np.hypot(nodes[i, 0] - x_m, nodes[i, 1] - y_m)
        if total < best and segment_free(space, x_m, y_m, nodes[i, 0], nodes[i, 1]):
            best = total
    return best
