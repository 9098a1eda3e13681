"""Points in square buckets, so that a growing tree finds its neighbours without a search tree."""

from typing import NamedTuple

import numpy as np
from numba import njit

from steerlab.sim.arrays import FloatArray, IntArray


class Buckets(NamedTuple):
    """Linked lists of point indices, one per bucket; filled by ``bucket_add``.

    Attributes:
        first: (n, n) newest point of each bucket, -1 where empty.
        following: (points,) the next point of the same bucket, -1 at the end.
        half_extent_m: of the ground.
        size_m: side of a bucket.
    """

    first: IntArray
    following: IntArray
    half_extent_m: float
    size_m: float


@njit(cache=True)
def empty_buckets(capacity: int, half_extent_m: float, size_m: float) -> Buckets:
    """Buckets for up to ``capacity`` points on the ground."""
    side = int(np.ceil(2.0 * half_extent_m / size_m)) + 1
    first = np.full((side, side), -1, dtype=np.int64)
    return Buckets(first, np.full(capacity, -1, dtype=np.int64), half_extent_m, size_m)


@njit(cache=True)
def bucket_index(buckets: Buckets, coordinate_m: float) -> int:
    """Row or column of a coordinate, clipped to the ground."""
    index = int((coordinate_m + buckets.half_extent_m) / buckets.size_m)
    return min(max(index, 0), buckets.first.shape[0] - 1)


@njit(cache=True)
def bucket_add(buckets: Buckets, point: int, x_m: float, y_m: float) -> None:
    """Put a point into its bucket."""
    i, j = bucket_index(buckets, x_m), bucket_index(buckets, y_m)
    buckets.following[point] = buckets.first[i, j]
    buckets.first[i, j] = point


@njit(cache=True)
def points_within(
    buckets: Buckets, points: FloatArray, x_m: float, y_m: float, radius_m: float, nearby: IntArray
) -> int:
    """Write the points within a radius into ``nearby``; returns how many (at most its length)."""
    count = 0
    for i in range(
        bucket_index(buckets, x_m - radius_m), bucket_index(buckets, x_m + radius_m) + 1
    ):
        for j in range(
            bucket_index(buckets, y_m - radius_m), bucket_index(buckets, y_m + radius_m) + 1
        ):
            point = buckets.first[i, j]
            while point >= 0:
                dx, dy = points[point, 0] - x_m, points[point, 1] - y_m
                if dx * dx + dy * dy <= radius_m * radius_m and count < nearby.shape[0]:
                    nearby[count] = point
                    count += 1
                point = buckets.following[point]
    return count


@njit(cache=True)
def nearest_point(buckets: Buckets, points: FloatArray, x_m: float, y_m: float) -> int:
    """The nearest point, -1 if there is none; looks in rings of buckets, from the inside out."""
    side = buckets.first.shape[0]
    ci, cj = bucket_index(buckets, x_m), bucket_index(buckets, y_m)
    best, best_squared = -1, np.inf
    for ring in range(side):
        if best >= 0 and (ring - 1) * buckets.size_m > np.sqrt(best_squared):
            break
        for i in range(max(ci - ring, 0), min(ci + ring, side - 1) + 1):
            inner = abs(i - ci) < ring
            for j in range(cj - ring, cj + ring + 1, 2 * ring if inner else 1):
                if j < 0 or j >= side:
                    continue
                point = buckets.first[i, j]
                while point >= 0:
                    dx, dy = points[point, 0] - x_m, points[point, 1] - y_m
                    squared = dx * dx + dy * dy
                    if squared < best_squared:
                        best, best_squared = point, squared
                    point = buckets.following[point]
    return int(best)
