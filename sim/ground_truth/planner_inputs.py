"""Inputs of the search for a label's path: world, car, clearances and the routes to the ball."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.sim.arrays import IntArray
from steerlab.sim.ground_truth.distance_grid import Body, DistanceGrid, Keep
from steerlab.sim.ground_truth.rrt_star import PointTree
from steerlab.sim.ground_truth.stanley import Steering

UNKNOWN_CORNER = -1
SMALL_TURN_RAD = 0.5  # below it left and right are the same route
RAMP_M = 4.0  # within which a car that is too near a block must have got clear of it
DRIVE_SLACK_M = 0.15  # the discs are 0.24 m wider than the car


class Route(NamedTuple):
    """The way a label went, which hysteresis remembers.

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
    """The routes of a tree, by following each node's parents once."""
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


@njit(cache=True)
def verified(body: Body, start_m: float) -> Keep:
    """Clearance a simulated drive must keep: less than the car's, as later labels can correct."""
    full_m = body.radius_m - DRIVE_SLACK_M
    return Keep(min(start_m, full_m), full_m, RAMP_M)


class PlannerInputs(NamedTuple):
    """What ``turn_and_go`` needs to know about the world and the car.

    Attributes:
        square_grid: distances in the maximum norm; see ``square_distance_grid``.
        radii_m: planned and tightest turning radius.
        extra_m: what a turn at each of these radii costs on top of its length.
        clearance_m: what the car must keep on a path with each of these radii.
        grown_m: by how much the blocks of the point tree are grown.
    """

    tree: PointTree
    routes: RouteMap
    grid: DistanceGrid
    square_grid: DistanceGrid
    body: Body
    steering: Steering
    ball: tuple[float, float]
    radii_m: tuple[float, float]
    extra_m: tuple[float, float]
    clearance_m: tuple[float, float]
    grown_m: float
    path_step_m: float
    hysteresis_m: float
    verify_s: float
