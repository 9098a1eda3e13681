"""``PlannerInputs``: what the search for a label's path knows about the world, the car and its room."""

from typing import NamedTuple

from numba import njit

from steerlab.sim.ground_truth.distance_grid import Body, DistanceGrid, Keep
from steerlab.sim.ground_truth.route import RouteMap
from steerlab.sim.ground_truth.rrt_star import PointTree
from steerlab.sim.ground_truth.stanley import Steering

RAMP_M = 4.0  # within which a car that is too near a block must have got clear of it
DRIVE_SLACK_M = 0.15  # the discs are 0.24 m wider than the car


@njit(cache=True)
def verified(body: Body, start_m: float) -> Keep:
    """What a simulated drive must keep: it foretells, and the next label can still correct it."""
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
