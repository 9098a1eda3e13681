"""Dynamic time warping of labels onto the truth: fastdtw as in the paper, and the exact path."""

from dataclasses import dataclass
from typing import Literal, get_args

import fastdtw
import numpy as np
import numpy.typing as npt
from numba import njit

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

IntArray = npt.NDArray[np.int64]
WarpingMethod = Literal["exact", "fastdtw"]
METHODS: tuple[WarpingMethod, ...] = get_args(WarpingMethod)

FASTDTW_RADIUS = 10
"""The paper names no radius. 1, the default, errs by several percent and can flip a sign."""

_DIAGONAL, _LABEL, _TRUTH = 0, 1, 2  # which index a step of the path advances


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Warping:
    """A path that matches every label to truth without going back in time.

    Attributes:
        method: how the path was found.
        distance: sum of |label - truth| along the path; no path has a smaller one than ``exact``.
        label_index: (K,) indices into the labels along the path, from 0 to the last.
        truth_index: (K,) indices into the truth.
    """

    method: WarpingMethod
    distance: float
    label_index: IntArray
    truth_index: IntArray


def warp(label: FloatArray, truth: FloatArray, method: WarpingMethod = "exact") -> Warping:
    """Match ``label`` (n,) to ``truth`` (m,) by DTW with steps (1, 0), (0, 1) and (1, 1).

    ``exact`` fills the whole n by m table. Of equally good paths it takes diagonal steps, and else
    the step back towards equal indices, so that plateaus add neither length nor lag. ``fastdtw``
    (Salvador & Chan 2004) searches a band of radius 10 around the path of the halved signals.

    Raises:
        InvalidConfig: a signal is empty, not 1-D or not finite, or the method is unknown.
    """
    for name, signal in (("label", label), ("truth", truth)):
        if signal.ndim != 1 or len(signal) == 0 or not np.isfinite(signal).all():
            raise InvalidConfig(
                f"{name} has shape {signal.shape} or values that are not finite; "
                "give (steps,), not empty, and leave masked steps out."
            )
    if method == "exact":
        distance, label_index, truth_index = _exact(
            np.ascontiguousarray(label, dtype=np.float64),
            np.ascontiguousarray(truth, dtype=np.float64),
        )
    elif method == "fastdtw":
        # Without `dist` fastdtw takes |a - b|, the 1-D Euclidean distance, and runs faster.
        distance, path = fastdtw.fastdtw(label, truth, radius=FASTDTW_RADIUS)
        label_index, truth_index = np.array(path, dtype=np.int64).T
    else:
        raise InvalidConfig(f"No DTW method {method!r}; choose one of {', '.join(METHODS)}.")
    return Warping(
        method=method,
        distance=float(distance),
        label_index=label_index,
        truth_index=truth_index,
    )


@njit(cache=True)
def _exact(label: FloatArray, truth: FloatArray) -> tuple[float, IntArray, IntArray]:
    """Distance and path; two rows of costs, and one byte a cell to walk back by."""
    n, m = len(label), len(truth)
    came_by = np.empty((n, m), dtype=np.int8)
    above = np.full(m, np.inf)
    row = np.empty(m)
    for i in range(n):
        for j in range(m):
            here = abs(label[i] - truth[j])
            if i == 0 and j == 0:
                row[j], came_by[i, j] = here, _DIAGONAL
                continue
            diagonal = above[j - 1] if i > 0 and j > 0 else np.inf
            by_label = above[j] if i > 0 else np.inf
            by_truth = row[j - 1] if j > 0 else np.inf
            if diagonal <= by_label and diagonal <= by_truth:
                best, step = diagonal, _DIAGONAL
            elif by_label < by_truth or (by_label == by_truth and i > j):
                best, step = by_label, _LABEL
            else:
                best, step = by_truth, _TRUTH
            row[j], came_by[i, j] = here + best, step
        above, row = row, above
    label_index = np.empty(n + m - 1, dtype=np.int64)
    truth_index = np.empty(n + m - 1, dtype=np.int64)
    at, i, j = n + m - 2, n - 1, m - 1
    while True:
        label_index[at], truth_index[at] = i, j
        if i == 0 and j == 0:
            break
        step = came_by[i, j]
        if step != _TRUTH:
            i -= 1
        if step != _LABEL:
            j -= 1
        at -= 1
    return above[m - 1], label_index[at:].copy(), truth_index[at:].copy()
