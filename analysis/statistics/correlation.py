"""Pearson's and Spearman's correlation, and the paper's choice between them by two checks."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from math import atanh, sqrt, tanh
from typing import Literal

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, pearsonr, shapiro, spearmanr

from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked,
    checked_confidence,
    checked_pairs,
    flat,
    too_few,
)
from steerlab.sim.arrays import FloatArray

MOST_EXACT = 9  # all orders of nine are counted in a moment; R counts to nine, too
MOST_FOR_SHAPIRO = 5000  # Royston's p-value (AS R94, 1995) was fitted up to here
CHECK_ALPHA = 0.05
LABEL = "paper-compatible"
_EXACT_FIT = 1e-20  # of the variance of y: what a line leaves of itself is rounding
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, slots=True)
class Correlation:
    """How two quantities go together.

    Attributes:
        r: the coefficient, -1 to 1; it is the effect size.
        p: two-sided.
        p_from: ``t`` (n - 2 degrees of freedom) or ``exact`` (all orders counted).
    """

    method: Literal["pearson", "spearman"]
    r: float
    p: float
    interval: ConfidenceInterval
    n: int
    p_from: Literal["t", "exact"]


@dataclass(frozen=True, kw_only=True, slots=True)
class AssumptionCheck:
    """One test of an assumption; a small ``p`` speaks against it.

    Attributes:
        statistic: W of Shapiro-Wilk, chi² with one degree of freedom of the score test.
    """

    statistic: float
    p: float


@dataclass(frozen=True, kw_only=True, slots=True)
class PaperCorrelation:
    """A correlation by the paper's rule, and why it is of its kind.

    Attributes:
        correlation: Pearson's if no check failed, else Spearman's.
        why: the checks that failed; empty if none did.
        label: that this is the paper's rule. A test chosen by the data has no exact level.
    """

    correlation: Correlation
    why: tuple[str, ...]
    label: Literal["paper-compatible"] = LABEL


def pearson(
    x: FloatArray, y: FloatArray, *, confidence: float = 0.95
) -> Correlation | NotComputable:
    """Pearson's r with Fisher's interval; R's ``cor.test``. ``x`` and ``y`` are (n,).

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    x, y = checked_pairs(x, y)
    checked_confidence(confidence)
    if missing := _not_comparable(x, y):
        return missing
    result = pearsonr(x, y)
    r, p = map(float, result)
    low, high = result.confidence_interval(confidence)
    return Correlation(
        method="pearson",
        r=r,
        p=p,
        interval=ConfidenceInterval(low=float(low), high=float(high), confidence=confidence),
        n=len(x),
        p_from="t",
    )


def spearman(
    x: FloatArray, y: FloatArray, *, confidence: float = 0.95
) -> Correlation | NotComputable:
    """Spearman's rho of ``x`` and ``y`` (n,), ties at their mean rank.

    Up to nine people without ties p counts all orders, R's ``cor.test(method = "spearman")``; else
    it is that of t, R's ``cor.test(..., exact = FALSE)``. R's default for larger samples without
    ties is an Edgeworth series, which differs in the third digit. The interval is Fisher's with
    Bonett & Wright's variance (1 + rho²/2) / (n - 3), Psychometrika 65, 2000.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    x, y = checked_pairs(x, y)
    checked_confidence(confidence)
    if missing := _not_comparable(x, y):
        return missing
    n = len(x)
    r, p_of_t = map(float, spearmanr(x, y))
    exact = n <= MOST_EXACT and len(np.unique(x)) == len(np.unique(y)) == n
    half = float(ndtri(0.5 + confidence / 2.0)) * sqrt((1.0 + r * r / 2.0) / (n - 3))
    low, high = (r, r) if abs(r) >= 1.0 else (tanh(atanh(r) - half), tanh(atanh(r) + half))
    return Correlation(
        method="spearman",
        r=r,
        p=_share_of_orders(r, n) if exact else p_of_t,
        interval=ConfidenceInterval(low=low, high=high, confidence=confidence),
        n=n,
        p_from="exact" if exact else "t",
    )


def shapiro_wilk(values: FloatArray) -> AssumptionCheck | NotComputable:
    """Shapiro-Wilk's test of normality, R's ``shapiro.test``; ``values`` (n,).

    Raises:
        InvalidConfig: a value is not finite.
    """
    values = checked("values", values)
    if missing := too_few(len(values)) or flat("the sample", values):
        return missing
    if len(values) > MOST_FOR_SHAPIRO:
        return NotComputable(
            reason=f"{len(values)} values; Shapiro-Wilk's p-value holds to {MOST_FOR_SHAPIRO}"
        )
    values = values - values.mean()
    result = shapiro(values / np.abs(values).max())  # W has no unit; scipy calls a tiny range none
    return AssumptionCheck(statistic=float(result.statistic), p=float(result.pvalue))


def score_test(x: FloatArray, y: FloatArray) -> AssumptionCheck | NotComputable:
    """Non-constant variance score test of the line ``y ~ x`` over its fitted values.

    Breusch & Pagan (1979), Cook & Weisberg (1983); R's ``car::ncvTest(lm(y ~ x))``, statsmodels'
    ``het_breuschpagan(residuals, [1, fitted], robust=False)``. Its default, ``robust=True``, is
    Koenker's, another test.

    Raises:
        InvalidConfig: lengths differ or a value is not finite.
    """
    x, y = checked_pairs(x, y)
    if missing := _not_comparable(x, y):
        return missing
    centred = (x - x.mean()) / x.std()
    slope = centred @ y / len(x)
    residual = y - y.mean() - slope * centred
    if residual @ residual <= _EXACT_FIT * np.square(y - y.mean()).sum():
        return NotComputable(reason="y lies on a line, so no residual has a spread")
    if slope**2 <= _EXACT_FIT * y.var():
        return NotComputable(reason="the fitted line is level, so all fitted values are one")
    # Fitted values are a line in x, so scaled squares regressed on either explain the same.
    statistic = float((centred @ residual**2 / np.mean(residual**2)) ** 2 / (2.0 * len(x)))
    return AssumptionCheck(statistic=statistic, p=float(chi2.sf(statistic, 1)))


def paper_correlation(
    embedding: FloatArray, construct: FloatArray, *, confidence: float = 0.95
) -> PaperCorrelation | NotComputable:
    """Correlate one embedding dimension (n,) with one construct (n,), section Results.

    The paper says that it checked normality and equal variance and used Spearman's if data did not
    pass. We check both variables, and the variance of ``construct ~ embedding``, each at 5 %; a
    check that cannot be computed has not been passed.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    checks = {
        "the embedding is not normal": shapiro_wilk(embedding),
        "the construct is not normal": shapiro_wilk(construct),
        "the variance is not constant": score_test(embedding, construct),
    }
    why = tuple(
        name
        for name, check in checks.items()
        if isinstance(check, NotComputable) or check.p < CHECK_ALPHA
    )
    correlation = (spearman if why else pearson)(embedding, construct, confidence=confidence)
    if isinstance(correlation, NotComputable):
        return correlation
    return PaperCorrelation(correlation=correlation, why=why)


def _not_comparable(x: FloatArray, y: FloatArray) -> NotComputable | None:
    return too_few(len(x)) or flat("x", x) or flat("y", y)


def _share_of_orders(r: float, n: int) -> float:
    """Twice the share of orders at least as far on this side, as R counts it."""
    squared = (1.0 - r) * n * (n * n - 1) / 6.0  # the sum of squared rank differences
    of_orders = _squared_differences(n)
    below = float(np.mean(of_orders <= squared + _ROUNDING * n**3))
    above = float(np.mean(of_orders >= squared - _ROUNDING * n**3))
    return min(1.0, 2.0 * min(below, above))


@lru_cache(maxsize=MOST_EXACT)
def _squared_differences(n: int) -> FloatArray:
    """Sums of squared rank differences of all orders of n people, (n!,)."""
    orders = np.array(list(permutations(range(n))), dtype=np.int8)
    return np.square(orders - np.arange(n)).sum(axis=1).astype(np.float64)
