"""Two conditions within people: Wilcoxon's signed ranks, and McNemar's exact test of yes and no."""

from dataclasses import dataclass
from math import floor, sqrt
from typing import Literal

import numpy as np
from scipy.stats import beta, binom, norm, rankdata

from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked_confidence,
    checked_pairs,
    too_few,
)
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

MOST_EXACT = 49  # as in R


@dataclass(frozen=True, kw_only=True, slots=True)
class SignedRanks:
    """Wilcoxon's signed-rank test of paired differences.

    Attributes:
        v: sum of the ranks of positive differences.
        p_from: ``exact``, or ``normal`` with ties' and continuity corrections.
        rank_biserial: (positive - negative) / all rank sums, -1 to 1, the effect size.
        shift: Hodges & Lehmann's estimate, the median of means of two differences.
        interval: of the shift.
        equal: people without a difference; they count in the shift alone.
    """

    v: float
    p: float
    p_from: Literal["exact", "normal"]
    rank_biserial: float
    shift: float
    interval: Interval
    n: int
    equal: int


@dataclass(frozen=True, kw_only=True, slots=True)
class McNemar:
    """Success under two conditions within people.

    Attributes:
        p: exact, two-sided: the binomial test of ``only_first`` among all who differ.
        share: of those who differ, who succeeded under the first only; 1/2 if nothing differs.
        share_interval: Clopper & Pearson's.
        difference: success rate of the first less that of the second, the effect size.
        difference_interval: Bonett & Price's adjusted Wald (2012).
    """

    only_first: int
    only_second: int
    p: float
    share: float
    share_interval: Interval
    difference: float
    difference_interval: Interval
    n: int


def wilcoxon(
    first: FloatArray, second: FloatArray, *, confidence: float = 0.95
) -> SignedRanks | NotComputable:
    """Paired Wilcoxon test, (n,) each; R's ``wilcox.test(first, second, paired = TRUE)``.

    As in R the p-value is exact below 50 people without ties or equal pairs. The interval comes
    from the means of two differences; with ties R searches for it in another way.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    first, second = checked_pairs(first, second)
    checked_confidence(confidence)
    all_differences = first - second
    differences = all_differences[all_differences != 0.0]
    n = len(differences)
    if missing := too_few(len(first)):
        return missing
    if n == 0:
        return NotComputable(reason="nobody differs between the two conditions")
    ranks = rankdata(np.abs(differences))
    v = float(ranks[differences > 0.0].sum())
    tied = len(np.unique(ranks)) < n
    exact = not tied and n == len(first) and n <= MOST_EXACT
    means = _means_of_two(all_differences)
    all_ranks = n * (n + 1) / 2.0
    rank = _interval_rank(len(first), exact, confidence)
    return SignedRanks(
        v=v,
        p=_exact_p(v, n) if exact else _normal_p(v, ranks),
        p_from="exact" if exact else "normal",
        rank_biserial=(2.0 * v - all_ranks) / all_ranks,
        shift=float(np.median(means)),
        interval=Interval(
            low=float(means[rank - 1]), high=float(means[-rank]), confidence=confidence
        ),
        n=len(first),
        equal=len(first) - n,
    )


def mcnemar(
    first: FloatArray, second: FloatArray, *, confidence: float = 0.95
) -> McNemar | NotComputable:
    """Exact McNemar test of 0 and 1, (n,) each; R's ``binom.test`` of those who differ.

    Raises:
        InvalidConfig: a value is neither 0 nor 1, lengths differ or ``confidence`` is no level.
    """
    first, second = checked_pairs(first, second)
    checked_confidence(confidence)
    if other := sorted(set(np.unique([first, second]).tolist()) - {0.0, 1.0}):
        raise InvalidConfig(f"success has {other[0]:g}; it must be 0 or 1.")
    n = len(first)
    if missing := too_few(n):
        return missing
    more, less = int((first > second).sum()), int((first < second).sum())
    differ = more + less
    if differ == 0:
        return NotComputable(reason="nobody differs between the two conditions")
    tail = (1.0 - confidence) / 2.0
    share_low = float(beta.ppf(tail, more, less + 1)) if more else 0.0
    share_high = float(beta.isf(tail, more + 1, less)) if less else 1.0
    one, other = (more + 1) / (n + 2), (less + 1) / (n + 2)
    half = float(norm.isf(tail)) * sqrt((one + other - (one - other) ** 2) / (n + 2))
    return McNemar(
        only_first=more,
        only_second=less,
        p=min(1.0, 2.0 * float(binom.cdf(min(more, less), differ, 0.5))),
        share=more / differ,
        share_interval=Interval(low=share_low, high=share_high, confidence=confidence),
        difference=(more - less) / n,
        difference_interval=Interval(
            low=max(-1.0, one - other - half),
            high=min(1.0, one - other + half),
            confidence=confidence,
        ),
        n=n,
    )


def _means_of_two(differences: FloatArray) -> FloatArray:
    i, j = np.triu_indices(len(differences))
    return np.sort((differences[i] + differences[j]) / 2.0)


def _signed_rank_shares(n: int) -> FloatArray:
    """Probability that the positive rank sum is 0, 1, ... n(n+1)/2 under the null."""
    shares = np.zeros(n * (n + 1) // 2 + 1)
    shares[0] = 1.0
    for rank in range(1, n + 1):
        moved = np.zeros_like(shares)
        moved[rank:] = shares[:-rank]
        shares = (shares + moved) / 2.0
    return shares


def _exact_p(v: float, n: int) -> float:
    shares = _signed_rank_shares(n)
    at = round(v)
    return min(1.0, 2.0 * float(min(shares[: at + 1].sum(), shares[at:].sum())))


def _normal_p(v: float, ranks: FloatArray) -> float:
    n = len(ranks)
    tied = np.unique(ranks, return_counts=True)[1].astype(np.float64)
    variance = n * (n + 1) * (2 * n + 1) / 24.0 - (tied**3 - tied).sum() / 48.0
    away = max(0.0, abs(v - n * (n + 1) / 4.0) - 0.5)
    return min(1.0, float(2.0 * norm.sf(away / sqrt(variance))))


def _interval_rank(n: int, exact: bool, confidence: float) -> int:
    """Which smallest and largest mean of two ends the interval, from 1."""
    tail = (1.0 - confidence) / 2.0
    if exact:
        below = np.cumsum(_signed_rank_shares(n))
        return max(1, int(np.searchsorted(below, tail)))
    spread = sqrt(n * (n + 1) * (2 * n + 1) / 24.0)
    return max(1, floor(n * (n + 1) / 4.0 - float(norm.isf(tail)) * spread))
