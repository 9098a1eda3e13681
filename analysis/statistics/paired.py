"""Two conditions within people: Wilcoxon's signed ranks, McNemar's test, and all pairs with Holm."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from math import floor, sqrt
from typing import Generic, Literal, TypeVar

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import binomtest, rankdata

from steerlab.analysis.statistics.attainable import by_signs
from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked_confidence,
    checked_pairs,
    checked_success,
    checked_table,
    too_few,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

MOST_EXACT = 49  # as in R
_NOBODY = "nobody differs between the two conditions"


@dataclass(frozen=True, kw_only=True, slots=True)
class SignedRanks:
    """Wilcoxon's signed-rank test of paired differences.

    Attributes:
        v: sum of the ranks of positive differences.
        p_from: ``exact``, or ``normal`` with ties' and continuity corrections.
        smallest_p: that there can be with so many differences.
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
    interval: ConfidenceInterval | NotComputable
    n: int
    equal: int
    smallest_p: float


@dataclass(frozen=True, kw_only=True, slots=True)
class McNemar:
    """Success under two conditions within people.

    Attributes:
        p: exact, two-sided: the binomial test of ``only_first`` among all who differ.
        share: of those who differ, who succeeded under the first only.
        share_interval: Clopper & Pearson's.
        difference: success rate of the first less that of the second, the effect size.
        difference_interval: Bonett & Price's adjusted Wald (2012).
        smallest_p: that there can be if so many differ.
    """

    only_first: int
    only_second: int
    p: float
    share: float
    share_interval: ConfidenceInterval
    difference: float
    difference_interval: ConfidenceInterval
    n: int
    smallest_p: float


PairTest = TypeVar("PairTest", SignedRanks, McNemar)


@dataclass(frozen=True, kw_only=True, slots=True)
class ConditionPair(Generic[PairTest]):
    """Two conditions compared; ``p_holm`` counts the pairs that could be tested.

    Attributes:
        smallest_p_holm: the smallest ``p_holm`` that there can be.
    """

    first: str
    second: str
    test: PairTest | NotComputable
    p_holm: float | NotComputable
    smallest_p_holm: float | NotComputable


def wilcoxon(
    first: FloatArray, second: FloatArray, *, confidence: float = 0.95
) -> SignedRanks | NotComputable:
    """Paired Wilcoxon test, (n,) each; R's ``wilcox.test(first, second, paired = TRUE)``.

    As in R the p-value is exact below 50 people without ties or equal pairs. The interval comes
    from the means of two differences; with ties R searches for it in another way. Where not even
    the smallest and the largest mean reach ``confidence``, there is none; R gives these two.
    ``scipy.stats.wilcoxon`` has the same p, but neither an interval nor the distribution that the
    interval needs, and its p alone takes longer than all of this: simulated studies would wait.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    first, second = checked_pairs(first, second)
    checked_confidence(confidence)
    if missing := too_few(len(first)):
        return missing
    differences = first - second
    nonzero = differences[differences != 0.0]
    n = len(nonzero)
    if n == 0:
        return NotComputable(reason=_NOBODY)
    ranks = rankdata(np.abs(nonzero))
    v = float(ranks[nonzero > 0.0].sum())
    repeats = np.unique(ranks, return_counts=True)[1].astype(np.float64)
    exact = len(repeats) == n == len(first) <= MOST_EXACT
    i, j = _pairs_of_people(len(first))
    means = np.sort((differences[i] + differences[j]) / 2.0)
    rank = _interval_rank(len(first), (1.0 - confidence) / 2.0, exact)
    return SignedRanks(
        v=v,
        p=_exact_p(v, n) if exact else _normal_p(v, n, float((repeats**3 - repeats).sum())),
        p_from="exact" if exact else "normal",
        rank_biserial=4.0 * v / (n * (n + 1)) - 1.0,
        shift=float(np.median(means)),
        interval=NotComputable(
            reason=f"{len(first)} people are too few for a {100 * confidence:g} % interval of ranks"
        )
        if rank < 1
        else ConfidenceInterval(
            low=float(means[rank - 1]), high=float(means[-rank]), confidence=confidence
        ),
        n=len(first),
        equal=len(first) - n,
        smallest_p=by_signs(n),
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
    checked_success(np.concatenate([first, second]))
    n = len(first)
    if missing := too_few(n):
        return missing
    more, less = int((first > second).sum()), int((first < second).sum())
    if more + less == 0:
        return NotComputable(reason=_NOBODY)
    result = binomtest(more, more + less)
    share = result.proportion_ci(confidence, method="exact")
    up, down = (more + 1) / (n + 2), (less + 1) / (n + 2)  # adjusted shares
    half = float(ndtri(0.5 + confidence / 2.0))
    half *= sqrt((up + down - (up - down) ** 2) / (n + 2))
    return McNemar(
        only_first=more,
        only_second=less,
        p=float(result.pvalue),
        share=more / (more + less),
        share_interval=ConfidenceInterval(
            low=float(share.low), high=float(share.high), confidence=confidence
        ),
        difference=(more - less) / n,
        difference_interval=ConfidenceInterval(
            low=max(-1.0, up - down - half),
            high=min(1.0, up - down + half),
            confidence=confidence,
        ),
        n=n,
        smallest_p=by_signs(more + less),
    )


def all_pairs(
    table: FloatArray,
    conditions: Sequence[str],
    test: Callable[[FloatArray, FloatArray], PairTest | NotComputable],
) -> list[ConditionPair[PairTest]]:
    """Compare each two columns of ``table`` (people, conditions) by ``wilcoxon`` or ``mcnemar``.

    Raises:
        InvalidConfig: names and columns differ in number, or the test refuses the values.
    """
    table = checked_table("table", table)
    if len(conditions) != table.shape[1] or len(set(conditions)) != len(conditions):
        raise InvalidConfig(
            f"{table.shape[1]} columns and the names {list(conditions)}; give each its own."
        )
    pairs = list(combinations(range(len(conditions)), 2))
    tests = [test(table[:, first], table[:, second]) for first, second in pairs]
    known = [result for result in tests if not isinstance(result, NotComputable)]
    adjusted = iter(holm(np.array([result.p for result in known])).tolist())
    smallest = iter(holm(np.array([result.smallest_p for result in known])).tolist())
    return [
        ConditionPair(
            first=conditions[first],
            second=conditions[second],
            test=result,
            p_holm=result if isinstance(result, NotComputable) else next(adjusted),
            smallest_p_holm=result if isinstance(result, NotComputable) else next(smallest),
        )
        for (first, second), result in zip(pairs, tests, strict=True)
    ]


@lru_cache(maxsize=16)
def _pairs_of_people(n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(n)


@lru_cache(maxsize=MOST_EXACT)
def signed_rank_shares(n: int) -> FloatArray:
    """Probability that the positive rank sum is 0, 1, ... n(n+1)/2 under the null."""
    shares = np.zeros(n * (n + 1) // 2 + 1)
    shares[0] = 1.0
    for rank in range(1, n + 1):
        moved = np.zeros_like(shares)
        moved[rank:] = shares[:-rank]
        shares = (shares + moved) / 2.0
    return shares


def _exact_p(v: float, n: int) -> float:
    shares, v = signed_rank_shares(n), round(v)
    return min(1.0, 2.0 * float(min(shares[: v + 1].sum(), shares[v:].sum())))


def _normal_p(v: float, n: int, ties: float) -> float:
    away = max(0.0, abs(v - n * (n + 1) / 4.0) - 0.5)
    variance = n * (n + 1) * (2 * n + 1) / 24.0 - ties / 48.0
    return min(1.0, 2.0 * float(ndtr(-away / sqrt(variance))))


def _interval_rank(n: int, tail: float, exact: bool) -> int:
    """Which smallest and largest mean of two ends the interval, from 1; 0 if none does."""
    if exact:
        return int(np.searchsorted(np.cumsum(signed_rank_shares(n)), tail))
    spread = sqrt(n * (n + 1) * (2 * n + 1) / 24.0)
    return max(0, floor(n * (n + 1) / 4.0 + float(ndtri(tail)) * spread))
