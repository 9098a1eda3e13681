"""Corrections for many tests: Holm's and Benjamini & Hochberg's."""

import numpy as np
from scipy.stats import false_discovery_control

from steerlab.analysis.statistics.outcome import checked
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig


def holm(p: FloatArray) -> FloatArray:
    """Holm's adjusted p-values (m,), R's ``p.adjust(p, "holm")``: bounds the chance of any error.

    Tests that are not computable are no tests: leave them out, which makes m smaller.

    Raises:
        InvalidConfig: a value is no probability.
    """
    p = _checked(p)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return np.minimum(adjusted, 1.0)


def benjamini_hochberg(p: FloatArray) -> FloatArray:
    """Adjusted p-values (m,), R's ``p.adjust(p, "BH")``: bounds the share of false discoveries.

    Raises:
        InvalidConfig: a value is no probability.
    """
    return np.asarray(false_discovery_control(_checked(p), method="bh"))


def _checked(p: FloatArray) -> FloatArray:
    p = checked("p", p)
    if ((p < 0.0) | (p > 1.0)).any():
        raise InvalidConfig(f"p-values from {p.min()} to {p.max()}; they lie in 0 to 1.")
    return p
