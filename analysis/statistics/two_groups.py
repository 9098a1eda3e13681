"""Do two groups of people differ? Welch's t for one quantity, Hotelling's T² for an embedding."""

import warnings
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import ndtri, poch
from scipy.stats import ttest_ind

from steerlab.analysis.statistics.attainable import by_groups
from steerlab.analysis.statistics.multiple_correlation import (
    PERMUTATIONS,
    basis_of,
    explained_by,
    permutation_p,
    permuted,
)
from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked,
    checked_confidence,
    dependent,
    flat,
    too_few,
)
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig

FEWEST_IN_GROUP = 2
_ALIKE = "nobody differs within a group, so chance has no measure"


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
    interval: ConfidenceInterval
    g: float
    g_interval: ConfidenceInterval
    n: tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class HotellingT2:
    """Two groups' mean vectors compared.

    Attributes:
        p: by permuting who is in which group.
        distance: Mahalanobis distance of the means in pooled standard deviations, the effect size.
        smallest_p: that there can be with such groups and so many permutations.
    """

    t2: float
    p: float
    permutations: int
    distance: float
    n: tuple[int, int]
    dimensions: int
    smallest_p: float


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
    n, m = len(first), len(second)
    if missing := _too_few(n, m) or flat("both groups", np.concatenate([first, second])):
        return missing
    if flat("", first) and flat("", second):
        return NotComputable(reason=_ALIKE)
    with warnings.catch_warnings():  # of a constant group, which is fine if the other is not
        warnings.filterwarnings("ignore", "Precision loss", RuntimeWarning)
        result = ttest_ind(first, second, equal_var=False)
    statistic, p = map(float, result)
    low, high = result.confidence_interval(confidence)
    difference, freedom = float(first.mean() - second.mean()), n + m - 2
    pooled = sqrt(((n - 1) * first.var(ddof=1) + (m - 1) * second.var(ddof=1)) / freedom)
    unbiased = float(poch((freedom - 1) / 2.0, 0.5)) / sqrt(freedom / 2.0)  # Hedges' exact J
    g = unbiased * difference / pooled
    half = float(ndtri(0.5 + confidence / 2.0)) * sqrt((n + m) / (n * m) + g**2 / (2 * (n + m)))
    return WelchT(
        t=statistic,
        freedom=float(result.df),  # pyright: ignore[reportAttributeAccessIssue]
        p=p,
        difference=difference,
        interval=ConfidenceInterval(low=float(low), high=float(high), confidence=confidence),
        g=g,
        g_interval=ConfidenceInterval(low=g - half, high=g + half, confidence=confidence),
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
    if missing := _too_few(first, second) or too_few(n, max(4, size + 3)) or dependent(embedding):
        return missing
    # Total scatter is the same in every order, and T² grows with the share of it between groups.
    basis = basis_of(embedding)
    weight = np.where(in_first, 1.0 / first, -1.0 / second) * sqrt(first * second / n)
    between = float(explained_by(basis, weight))
    if between >= 1.0 - 1e-12:
        return NotComputable(reason=_ALIKE)
    t2 = (n - 2) * between / (1.0 - between)
    return HotellingT2(
        t2=t2,
        p=permutation_p(between, explained_by(basis, permuted(weight, permutations, rng))),
        permutations=permutations,
        distance=sqrt(t2 * n / (first * second)),
        n=(first, second),
        dimensions=size,
        smallest_p=by_groups(first, second, permutations),
    )


def _too_few(first: int, second: int) -> NotComputable | None:
    return too_few(min(first, second), FEWEST_IN_GROUP, "people in the smaller group")
