"""Intervals of explained variance from the noncentral F distribution."""

from math import isinf

from scipy.optimize import root_scalar
from scipy.stats import f, ncf

from steerlab.analysis.statistics.outcome import Interval


def explained_interval(
    statistic: float, between: float, within: float, *, n: float, confidence: float
) -> Interval:
    """Interval of the share of variance explained, lambda / (lambda + n).

    The noncentralities lambda under which an F as large, or as small, as ``statistic`` has half of
    1 - confidence (Steiger & Fouladi 1997). The design counts as fixed.

    Args:
        statistic: F; infinite where everything is explained.
        between, within: its degrees of freedom.
        n: observations; for a partial share, both degrees of freedom and 1.
    """
    if isinf(statistic):
        return Interval(low=1.0, high=1.0, confidence=confidence)
    tail = (1.0 - confidence) / 2.0
    low = _noncentrality(statistic, between, within, 1.0 - tail)
    high = _noncentrality(statistic, between, within, tail)
    return Interval(low=low / (low + n), high=high / (high + n), confidence=confidence)


def _noncentrality(statistic: float, between: float, within: float, share: float) -> float:
    """Lambda for which the distribution function at ``statistic`` is ``share``; at least 0."""
    if f.cdf(statistic, between, within) <= share:
        return 0.0

    def excess(noncentrality: float) -> float:
        return float(ncf.cdf(statistic, between, within, noncentrality)) - share

    top = 1.0 + statistic * between
    while excess(top) > 0.0:
        top *= 2.0
    return float(root_scalar(excess, bracket=(0.0, top), xtol=1e-10, rtol=1e-12).root)
