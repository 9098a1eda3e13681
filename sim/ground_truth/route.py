"""Routes: which way a label went, and which corners lie on a common way to the ball."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.ground_truth.rrt_star import PointTree

IntArray = NDArray[np.int64]

UNKNOWN_CORNER = -1
SMALL_TURN_RAD = 0.5  # below it left and right are the same route


class Route(NamedTuple):
    """Which way a label went; what hysteresis remembers.

    Attributes:
        turn_rad: the first turn, positive left.
        corner: index into ``PointTree.corners`` of the first corner; -1 if unknown.
    """

    turn_rad: float
    corner: int


ANY_ROUTE = Route(0.0, UNKNOWN_CORNER)  # what goes with every other route


class RouteMap(NamedTuple):
    """Which corners lie on a common route.

    Attributes:
        corner_of: (nodes,) first corner on each node's path, itself included.
        together: (k, k) whether one corner is on the path of the other.
    """

    corner_of: IntArray
    together: NDArray[np.bool_]


def route_map(tree: PointTree) -> RouteMap:
    """Follow each node's parents once."""
    corner_of = np.full(len(tree.points), UNKNOWN_CORNER)
    corner_of[tree.corners] = np.arange(len(tree.corners))
    for node in np.argsort(tree.cost_m, kind="stable"):
        if corner_of[node] < 0:
            corner_of[node] = corner_of[tree.parent[node]]
    together = np.eye(len(tree.corners), dtype=bool)
    for index, corner in enumerate(tree.corners):
        node = int(tree.parent[corner])
        while node >= 0:
            together[index, corner_of[node]] = together[corner_of[node], index] = True
            node = int(tree.parent[node])
    return RouteMap(corner_of, together)


@njit(cache=True)
def same_route(routes: RouteMap, before: Route, turn_rad: float, node: int) -> bool:
    """Whether turning onto ``node`` carries on the route before."""
    opposite = turn_rad * before.turn_rad < 0.0
    if opposite and min(abs(turn_rad), abs(before.turn_rad)) > SMALL_TURN_RAD:
        return False
    corner = routes.corner_of[node]
    if corner < 0 or before.corner < 0:
        return True
    return routes.together[corner, before.corner]
