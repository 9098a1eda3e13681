"""Corrections for many tests: Holm's and Benjamini & Hochberg's."""

import numpy as np

from steerlab.analysis.statistics.outcome import checked
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray


def holm(p: FloatArray) -> FloatArray:
    """Holm's adjusted p-values (m,), R's ``p.adjust(p, "holm")``: bounds the chance of any error.

    Tests that are not computable are no tests: leave them out, which makes m smaller.

    Raises:
        InvalidConfig: a value is no probability.
    """
    p = _checked(p)
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return _unsorted(np.minimum(stepped, 1.0), order)


def benjamini_hochberg(p: FloatArray) -> FloatArray:
    """Adjusted p-values (m,), R's ``p.adjust(p, "BH")``: bounds the share of false discoveries.

    Raises:
        InvalidConfig: a value is no probability.
    """
    p = _checked(p)
    order = np.argsort(p, kind="stable")[::-1]
    ranks = np.arange(len(p), 0, -1)
    stepped = np.minimum.accumulate(p[order] * len(p) / ranks)
    return _unsorted(np.minimum(stepped, 1.0), order)


def _checked(p: FloatArray) -> FloatArray:
    p = checked("p", p)
    if ((p < 0.0) | (p > 1.0)).any():
        raise InvalidConfig(f"p-values from {p.min()} to {p.max()}; they lie in 0 to 1.")
    return p


def _unsorted(adjusted: FloatArray, order: np.ndarray) -> FloatArray:
    result = np.empty_like(adjusted)
    result[order] = adjusted
    return result
