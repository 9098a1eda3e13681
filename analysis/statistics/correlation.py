"""Pearson's and Spearman's correlation with p-values and intervals."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from math import atanh, sqrt, tanh
from typing import Literal

import numpy as np
from scipy.stats import norm, rankdata, t

from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked_confidence,
    checked_pairs,
    flat,
    too_few,
)
from steerlab.sim.rollout import FloatArray

CorrelationMethod = Literal["pearson", "spearman"]
MOST_EXACT = 9  # all orders of nine are counted in a moment; R counts to nine, too
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, slots=True)
class Correlation:
    """How two quantities go together.

    Attributes:
        r: the coefficient, -1 to 1; it is the effect size.
        p: two-sided.
        p_from: ``t`` (n - 2 degrees of freedom) or ``exact`` (all orders counted).
    """

    method: CorrelationMethod
    r: float
    p: float
    interval: Interval
    n: int
    p_from: Literal["t", "exact"]


def pearson(
    x: FloatArray, y: FloatArray, *, confidence: float = 0.95
) -> Correlation | NotComputable:
    """Pearson's r with Fisher's interval; R's ``cor.test``. ``x`` and ``y`` are (n,).

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    return _correlation("pearson", *checked_pairs(x, y), checked_confidence(confidence))


def spearman(
    x: FloatArray, y: FloatArray, *, confidence: float = 0.95
) -> Correlation | NotComputable:
    """Spearman's rho, ties at their mean rank.

    Up to nine people without ties p counts all orders, R's ``cor.test(method = "spearman")``; else
    it is that of t, R's ``cor.test(..., exact = FALSE)``. R's default for larger samples without
    ties is an Edgeworth series, which differs in the third digit. The interval is Fisher's with
    Bonett & Wright's variance (1 + rho²/2) / (n - 3), Psychometrika 65, 2000.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    return _correlation("spearman", *checked_pairs(x, y), checked_confidence(confidence))


def _correlation(
    method: CorrelationMethod, x: FloatArray, y: FloatArray, confidence: float
) -> Correlation | NotComputable:
    n = len(x)
    if missing := too_few(n) or flat("x", x) or flat("y", y):
        return missing
    ranked = method == "spearman"
    ties = ranked and (len(np.unique(x)) < n or len(np.unique(y)) < n)
    r = _coefficient(rankdata(x), rankdata(y)) if ranked else _coefficient(x, y)
    exact = ranked and not ties and n <= MOST_EXACT
    return Correlation(
        method=method,
        r=r,
        p=_exact_p(r, n) if exact else p_of_r(r, n),
        interval=_interval(r, n, 1.0 + r * r / 2.0 if ranked else 1.0, confidence),
        n=n,
        p_from="exact" if exact else "t",
    )


def p_of_r(r: float, n: int) -> float:
    """Two-sided p of a correlation ``r`` among ``n`` people, by t with n - 2 degrees of freedom."""
    if abs(r) >= 1.0:
        return 0.0
    return float(2.0 * t.sf(abs(r) * sqrt((n - 2) / (1.0 - r * r)), n - 2))


def _coefficient(x: FloatArray, y: FloatArray) -> float:
    x, y = x - x.mean(), y - y.mean()
    x, y = x / np.abs(x).max(), y / np.abs(y).max()  # squares of tiny numbers would be 0
    return float(np.clip(x @ y / sqrt((x @ x) * (y @ y)), -1.0, 1.0))


def _interval(r: float, n: int, variance: float, confidence: float) -> Interval:
    if abs(r) >= 1.0:
        return Interval(low=r, high=r, confidence=confidence)
    half = float(norm.ppf(0.5 + confidence / 2.0)) * sqrt(variance / (n - 3))
    centre = atanh(r)
    return Interval(low=tanh(centre - half), high=tanh(centre + half), confidence=confidence)


def _exact_p(r: float, n: int) -> float:
    """Twice the share of orders at least as far on this side, as R counts it."""
    squared = (1.0 - r) * n * (n * n - 1) / 6.0  # the sum of squared rank differences
    found = _squared_differences(n)
    below = float(np.mean(found <= squared + _ROUNDING * n**3))
    above = float(np.mean(found >= squared - _ROUNDING * n**3))
    return min(1.0, 2.0 * min(below, above))


@lru_cache(maxsize=MOST_EXACT)
def _squared_differences(n: int) -> FloatArray:
    orders = np.array(list(permutations(range(n))), dtype=np.int8)
    return np.square(orders - np.arange(n)).sum(axis=1).astype(np.float64)
