"""Do two groups of people differ? Welch's t for one quantity, Hotelling's T² for an embedding."""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import gammaln
from scipy.stats import norm, t

from steerlab.analysis.statistics.multiple_correlation import dependent
from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked,
    checked_confidence,
    flat,
    too_few,
)
from steerlab.analysis.statistics.permutation import PERMUTATIONS, permutation_p, permuted
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import BoolArray, FloatArray

FEWEST_IN_GROUP = 2


@dataclass(frozen=True, kw_only=True, slots=True)
class WelchT:
    """Two groups' means compared without supposing equal variances.

    Attributes:
        difference: mean of the first group less that of the second.
        interval: of the difference.
        g: Hedges' g, the difference in pooled standard deviations, corrected for small samples.
        g_interval: by its large-sample variance (Hedges & Olkin 1985).
    """

    t: float
    freedom: float
    p: float
    difference: float
    interval: Interval
    g: float
    g_interval: Interval
    n: tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class HotellingT2:
    """Two groups' mean vectors compared.

    Attributes:
        p: by permuting who is in which group.
        distance: Mahalanobis distance of the means in pooled standard deviations, the effect size.
    """

    t2: float
    p: float
    permutations: int
    distance: float
    n: tuple[int, int]
    dimensions: int


def welch_t(
    first: FloatArray, second: FloatArray, *, confidence: float = 0.95
) -> WelchT | NotComputable:
    """Welch's t test, R's ``t.test(first, second)``; (n,) and (m,), which may differ.

    With 10 people against 24 Student's t can reject a true null at nearly three times its level
    when the smaller group varies more.

    Raises:
        InvalidConfig: a value is not finite, or ``confidence`` is no level.
    """
    first, second = checked("first", first), checked("second", second)
    checked_confidence(confidence)
    if missing := _too_few(len(first), len(second)):
        return missing
    if missing := flat("both groups", np.concatenate([first, second])):
        return missing
    n, m = len(first), len(second)
    of_first, of_second = first.var(ddof=1) / n, second.var(ddof=1) / m
    variance = of_first + of_second
    if flat("", first) and flat("", second):
        return NotComputable(reason="nobody differs within a group, so chance has no measure")
    freedom = variance**2 / (of_first**2 / (n - 1) + of_second**2 / (m - 1))
    difference = float(first.mean() - second.mean())
    statistic = difference / sqrt(variance)
    half = float(t.ppf(0.5 + confidence / 2.0, freedom)) * sqrt(variance)
    pooled = sqrt(((n - 1) * n * of_first + (m - 1) * m * of_second) / (n + m - 2))
    g = _small_sample(n + m - 2) * difference / pooled
    g_half = float(norm.ppf(0.5 + confidence / 2.0)) * sqrt(
        (n + m) / (n * m) + g**2 / (2 * (n + m))
    )
    return WelchT(
        t=statistic,
        freedom=float(freedom),
        p=float(2.0 * t.sf(abs(statistic), freedom)),
        difference=difference,
        interval=Interval(low=difference - half, high=difference + half, confidence=confidence),
        g=g,
        g_interval=Interval(low=g - g_half, high=g + g_half, confidence=confidence),
        n=(n, m),
    )


def hotelling_t2(
    embedding: FloatArray,
    in_first: BoolArray,
    *,
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
) -> HotellingT2 | NotComputable:
    """Hotelling's T² with pooled covariance, its p by permutation.

    Args:
        embedding: (n, d).
        in_first: (n,), True for those in the first group.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or there are too few permutations.
    """
    embedding = checked("embedding", embedding, 2)
    n, size = embedding.shape
    if in_first.shape != (n,) or in_first.dtype != np.bool_:
        raise InvalidConfig(f"in_first is {in_first.shape} {in_first.dtype}; give ({n},) bool.")
    first = int(in_first.sum())
    second = n - first
    if missing := _too_few(first, second) or too_few(n, max(4, size + 3)):
        return missing
    if missing := dependent(embedding):
        return missing
    # Total scatter is the same in every order, and T² grows with the share of it between groups.
    basis = np.linalg.qr(embedding - embedding.mean(axis=0))[0]
    weight = np.where(in_first, 1.0 / first, -1.0 / second) * sqrt(first * second / n)
    between = min(1.0, float(np.square(weight @ basis).sum()))
    of_chance = np.square(permuted(weight, permutations, rng) @ basis).sum(axis=1)
    if between >= 1.0 - 1e-12:
        return NotComputable(reason="nobody differs within a group, so chance has no measure")
    t2 = (n - 2) * between / (1.0 - between)
    return HotellingT2(
        t2=t2,
        p=permutation_p(between, of_chance),
        permutations=permutations,
        distance=sqrt(t2 * n / (first * second)),
        n=(first, second),
        dimensions=size,
    )


def _small_sample(freedom: int) -> float:
    """Hedges' exact correction J, which makes g unbiased."""
    return float(np.exp(gammaln(freedom / 2.0) - gammaln((freedom - 1) / 2.0))) / sqrt(
        freedom / 2.0
    )


def _too_few(first: int, second: int) -> NotComputable | None:
    return too_few(min(first, second), FEWEST_IN_GROUP, "people in the smaller group")
