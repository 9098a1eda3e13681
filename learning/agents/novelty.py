"""Which rows lie outside what is known: distance to the nearest row of another drive."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from steerlab.sim.rollout import FloatArray

QUANTILE = 0.9  # of known rows' own distances to other drives: further off is new
MOST_ROWS = 4000  # the newest; a tree of more slows a drive down


class Novelty:
    """One class by nearest neighbours; after Chernova & Veloso (2009), see ``confidence.py``.

    A drive's rows follow each other closely, so how far apart known rows are is measured between
    drives, and with a single drive everything is new.

    Args:
        drives: (rows, size) features of each drive learned from.
    """

    def __init__(self, drives: Sequence[FloatArray]) -> None:
        known = np.concatenate(list(drives))[-MOST_ROWS:]
        self._scale = known.std(axis=0) + 1e-3
        self._tree = KDTree(known / self._scale)
        self._limit = _limit([drive / self._scale for drive in drives])

    def __call__(self, features: FloatArray) -> FloatArray:
        """(rows, size) -> (rows,): distance over its limit; infinite while one drive is known."""
        if self._limit <= 0.0:
            return np.full(len(features), np.inf)
        distance, _ = self._tree.query(features / self._scale)
        return np.asarray(distance) / self._limit


def _limit(drives: Sequence[FloatArray]) -> float:
    if len(drives) < 2:
        return 0.0
    apart: list[FloatArray] = []
    for index, drive in enumerate(drives):
        others = np.concatenate([other for row, other in enumerate(drives) if row != index])
        distance, _ = KDTree(others).query(drive)
        apart.append(np.asarray(distance))
    return float(np.quantile(np.concatenate(apart), QUANTILE))
