"""Which rows lie outside what is known: how far off the nearest known row is."""

from collections.abc import Sequence

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.rollout import BoolArray

APART = 1  # decisions: what changes from one to the next in a drive is not new yet
MOST_ROWS = 4000  # the newest; a tree of more slows a drive down


class Novelty:
    """One class by nearest neighbours; after Chernova & Veloso (2009), see ``confidence.py``.

    Distance is measured in units of how much features change within ``APART`` decisions of the
    first drive, the median. How far drives are from each other would be no measure: it grows with
    every odd drive, until nothing is new.

    Args:
        drives: (rows, size) features of each drive learned from; of the first every decision, in
            order.
        known: (rows,) of each drive, which rows count as known; None: all.
    """

    def __init__(
        self, drives: Sequence[FloatArray], known: Sequence[BoolArray] | None = None
    ) -> None:
        from scipy.spatial import KDTree

        rows = np.concatenate(list(drives))
        counts = np.concatenate(list(known)) if known is not None else np.ones(len(rows), bool)
        self._scale = rows.std(axis=0) + 1e-3
        self._limit = _change(drives[0] / self._scale)
        kept = rows[counts][-MOST_ROWS:]
        self._tree = KDTree(kept / self._scale) if len(kept) else None

    def __call__(self, features: FloatArray) -> FloatArray:
        """(rows, size) -> (rows,): distance over its unit; infinite where nothing is known."""
        if self._tree is None or not self._limit > 0.0:
            return np.full(len(features), np.inf)
        distance, _ = self._tree.query(features / self._scale)
        return np.asarray(distance) / self._limit


def _change(drive: FloatArray) -> float:
    """Median distance between rows ``APART`` of each other; 0 if the drive is too short."""
    if len(drive) <= APART:
        return 0.0
    return float(np.median(np.linalg.norm(drive[APART:] - drive[:-APART], axis=1)))
