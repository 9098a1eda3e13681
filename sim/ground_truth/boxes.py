"""Blocks grown by the car's radius: where a point may go, and which points see each other."""

from typing import NamedTuple

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.world import WorldSpec

EDGE_M = 1e-9  # a path may touch a grown block, but not enter it


class FreeSpace(NamedTuple):
    """Free space of a point: inside the bounds and outside every box.

    Attributes:
        boxes: (n, 4) low_x, high_x, low_y, high_y of the grown blocks.
        bounds: (4,) likewise, of the shrunk ground.
    """

    boxes: FloatArray
    bounds: FloatArray


def free_space(world: WorldSpec, inflation_m: float) -> FreeSpace:
    """Grow the blocks and shrink the ground by ``inflation_m``.

    Square corners keep the space polygonal, so the shortest path is exactly computable. The ball
    may lie nearer to a block or the edge than a car's centre needs to come: there the growth is
    less, so that the ball stays in free space (the distance grid still guards the car).
    """
    ball_x, ball_y = world.ball_xy_m
    boxes = np.empty((len(world.blocks), 4))
    for row, block in zip(boxes, world.blocks, strict=True):
        to_ball_m = max(abs(ball_x - block.x_m) - block.half_x_m,
                        abs(ball_y - block.y_m) - block.half_y_m)  # fmt: skip
        grown_m = min(inflation_m, to_ball_m)
        row[:] = (
            block.x_m - block.half_x_m - grown_m,
            block.x_m + block.half_x_m + grown_m,
            block.y_m - block.half_y_m - grown_m,
            block.y_m + block.half_y_m + grown_m,
        )
    limit_m = world.half_extent_m - inflation_m
    bounds = np.array(
        (min(-limit_m, ball_x), max(limit_m, ball_x), min(-limit_m, ball_y), max(limit_m, ball_y))
    )
    return FreeSpace(boxes, bounds)


def free_corners(space: FreeSpace) -> FloatArray:
    """(n, 2) corners of the boxes that lie in free space: where shortest paths turn."""
    low_x, high_x, low_y, high_y = space.boxes.T
    corners = np.stack(
        [np.stack((x, y), axis=-1) for x in (low_x, high_x) for y in (low_y, high_y)], axis=1
    ).reshape(-1, 2)
    free = [point_free(space, float(x), float(y)) for x, y in corners]
    return np.ascontiguousarray(corners[np.array(free, dtype=bool)])


@njit(cache=True)
def point_free(space: FreeSpace, x_m: float, y_m: float) -> bool:
    """Whether a point lies inside the bounds and not inside a box; touching is allowed."""
    bounds = space.bounds
    if x_m < bounds[0] or x_m > bounds[1] or y_m < bounds[2] or y_m > bounds[3]:
        return False
    for box in space.boxes:
        if box[0] + EDGE_M < x_m < box[1] - EDGE_M and box[2] + EDGE_M < y_m < box[3] - EDGE_M:
            return False
    return True


@njit(cache=True)
def segment_free(space: FreeSpace, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a straight segment between two free points enters no box (exact, slab method)."""
    dx, dy = bx - ax, by - ay
    boxes = space.boxes
    for k in range(boxes.shape[0]):
        low_x, high_x = boxes[k, 0] + EDGE_M, boxes[k, 1] - EDGE_M
        low_y, high_y = boxes[k, 2] + EDGE_M, boxes[k, 3] - EDGE_M
        if max(ax, bx) <= low_x or min(ax, bx) >= high_x:
            continue
        if max(ay, by) <= low_y or min(ay, by) >= high_y:
            continue
        enter, leave = 0.0, 1.0
        if dx != 0.0:
            first, second = (low_x - ax) / dx, (high_x - ax) / dx
            enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
        if dy != 0.0:
            first, second = (low_y - ay) / dy, (high_y - ay) / dy
            enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
        if enter < leave:
            return False
    return True
