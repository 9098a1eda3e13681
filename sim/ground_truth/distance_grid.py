"""How far each spot of the ground is from the next block or from the ground's edge.

Kernels test the car as three discs, which is on the safe side; ``collision`` tests its rectangle.
"""

from collections.abc import Callable
from math import cos, sin
from typing import NamedTuple

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import Block, WorldSpec


class DistanceGrid(NamedTuple):
    """Signed distances at the corners of square cells; a tuple, so that kernels can take it.

    Attributes:
        distance_m: (n, n) at x = -half_extent + i * cell, y = -half_extent + j * cell; negative
            inside a block.
        half_extent_m: of the ground.
        cell_m: side of a cell.
    """

    distance_m: FloatArray
    half_extent_m: float
    cell_m: float


class Body(NamedTuple):
    """The car as three discs on its axis; positions are relative to its *rear axle*.

    Attributes:
        disc_offsets_m: (3,) ahead of the rear axle.
        radius_m: of each disc.
        wheelbase_m: front axle ahead of rear axle.
    """

    disc_offsets_m: FloatArray
    radius_m: float
    wheelbase_m: float


class Keep(NamedTuple):
    """What a path must keep from blocks: what the car has now, rising to the full clearance.

    A car already closer than the planner likes still gets a path, if it leads away.

    Attributes:
        start_m: least distance of the disc centres at first.
        full_m: the same once the car has gone ``ramp_m``.
        ramp_m: must be positive.
    """

    start_m: float
    full_m: float
    ramp_m: float


@njit(cache=True)
def needed_clearance_m(keep: Keep, along_m: float) -> float:
    """Least distance of the disc centres ``along_m`` into a path."""
    return keep.start_m + (keep.full_m - keep.start_m) * min(along_m / keep.ramp_m, 1.0)


def body_of(car: CarConfig) -> Body:
    """The discs of a car, seen from its rear axle."""
    offsets_m = np.array(car.disc_offsets_m) + car.wheelbase_m / 2.0
    return Body(offsets_m, car.disc_radius_m, car.wheelbase_m)


def distance_grid(world: WorldSpec, cell_m: float) -> DistanceGrid:
    """Euclidean distances, for the car's discs: exact at cell corners, interpolated between.

    The cells are a little smaller than ``cell_m`` where the ground is not a whole number of them.
    """
    return _grid_of(world, cell_m, _euclidean)


def square_distance_grid(world: WorldSpec, cell_m: float) -> DistanceGrid:
    """Distances in the maximum norm: its level lines are the grown blocks of ``boxes``."""
    return _grid_of(world, cell_m, _maximum_norm)


def _grid_of(
    world: WorldSpec, cell_m: float, fill: Callable[[FloatArray, float, int], FloatArray]
) -> DistanceGrid:
    cells = int(np.ceil(2.0 * world.half_extent_m / cell_m))
    blocks = np.array([(b.x_m, b.y_m, b.half_x_m, b.half_y_m) for b in world.blocks])
    distance_m = fill(blocks.reshape(-1, 4), world.half_extent_m, cells)
    return DistanceGrid(distance_m, world.half_extent_m, 2.0 * world.half_extent_m / cells)


@njit(cache=True)
def _euclidean(blocks: FloatArray, half_extent_m: float, cells: int) -> FloatArray:
    """(cells + 1, cells + 1) signed distances; ``blocks`` is (n, 4): centre and half sizes."""
    distance_m = _maximum_norm(blocks[:0], half_extent_m, cells)
    for i in range(cells + 1):
        x = half_extent_m * (2.0 * i / cells - 1.0)
        for j in range(cells + 1):
            y = half_extent_m * (2.0 * j / cells - 1.0)
            nearest = distance_m[i, j]
            for k in range(blocks.shape[0]):
                dx = abs(x - blocks[k, 0]) - blocks[k, 2]
                dy = abs(y - blocks[k, 1]) - blocks[k, 3]
                if max(dx, dy) >= nearest:
                    continue
                if dx > 0.0 and dy > 0.0:
                    nearest = min(nearest, np.sqrt(dx * dx + dy * dy))
                else:
                    nearest = max(dx, dy)
            distance_m[i, j] = nearest
    return distance_m


@njit(cache=True)
def _maximum_norm(blocks: FloatArray, half_extent_m: float, cells: int) -> FloatArray:
    """As ``_euclidean`` with max(|dx|, |dy|) for the distance."""
    distance_m = np.empty((cells + 1, cells + 1))
    for i in range(cells + 1):
        x = half_extent_m * (2.0 * i / cells - 1.0)
        for j in range(cells + 1):
            y = half_extent_m * (2.0 * j / cells - 1.0)
            nearest = half_extent_m - max(abs(x), abs(y))
            for k in range(blocks.shape[0]):
                dx = abs(x - blocks[k, 0]) - blocks[k, 2]
                dy = abs(y - blocks[k, 1]) - blocks[k, 3]
                nearest = min(nearest, max(dx, dy))
            distance_m[i, j] = nearest
    return distance_m


@njit(cache=True)
def distance_at(grid: DistanceGrid, x_m: float, y_m: float) -> float:
    """Interpolated distance from a point to the next block or edge; negative off the ground."""
    edge_m = grid.half_extent_m - max(abs(x_m), abs(y_m))
    if edge_m <= 0.0:
        return edge_m
    u = (x_m + grid.half_extent_m) / grid.cell_m
    v = (y_m + grid.half_extent_m) / grid.cell_m
    last = grid.distance_m.shape[0] - 2
    i, j = min(int(u), last), min(int(v), last)
    u -= i
    v -= j
    d = grid.distance_m
    low = d[i, j] + u * (d[i + 1, j] - d[i, j])
    high = d[i, j + 1] + u * (d[i + 1, j + 1] - d[i, j + 1])
    return low + v * (high - low)


@njit(cache=True)
def clearance_at(
    grid: DistanceGrid, body: Body, x_m: float, y_m: float, heading_rad: float
) -> float:
    """Least distance of the three disc centres to a block or edge, rear axle at (x, y).

    The car is clear of everything when this exceeds the disc radius.
    """
    cosine, sine = cos(heading_rad), sin(heading_rad)
    least = np.inf
    for offset_m in body.disc_offsets_m:
        least = min(least, distance_at(grid, x_m + offset_m * cosine, y_m + offset_m * sine))
    return least


def overlaps(pose: Pose2D, block: Block, car: CarConfig) -> bool:
    """Whether car and block overlap, by the separating axes of the two rectangles.

    Ericson, *Real-Time Collision Detection* (2005), section 4.4, in the plane.
    """
    dx, dy = block.x_m - pose.x_m, block.y_m - pose.y_m
    cosine, sine = cos(pose.heading_rad), sin(pose.heading_rad)
    half_l, half_w = car.length_m / 2.0, car.width_m / 2.0
    c, s = abs(cosine), abs(sine)
    return (
        abs(dx) < block.half_x_m + c * half_l + s * half_w
        and abs(dy) < block.half_y_m + s * half_l + c * half_w
        and abs(cosine * dx + sine * dy) < half_l + c * block.half_x_m + s * block.half_y_m
        and abs(cosine * dy - sine * dx) < half_w + s * block.half_x_m + c * block.half_y_m
    )


def collision(pose: Pose2D, world: WorldSpec, car: CarConfig) -> str | None:
    """A description of the block or edge that the car at ``pose`` overlaps, or None."""
    if max(abs(pose.x_m), abs(pose.y_m)) > world.half_extent_m:
        return f"off the ground of ±{world.half_extent_m:g} m"
    for block in world.blocks:
        if overlaps(pose, block, car):
            return f"in {block}"
    return None
