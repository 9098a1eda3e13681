"""Conditions within people by ranks: Friedman's test, and Cochran's Q where answers are yes or no."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, rankdata

from steerlab.analysis.statistics.bootstrap import (
    RESAMPLES,
    percentile_interval,
    resample_counts,
)
from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked_confidence,
    checked_table,
    too_few,
)
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray


@dataclass(frozen=True, kw_only=True, slots=True)
class RankedConditions:
    """Conditions compared by their ranks within each person.

    Attributes:
        statistic: Friedman's chi², or Cochran's Q.
        freedom: conditions - 1; ``p`` is that of chi².
        w: Kendall's coefficient of concordance, 0 to 1: how much people agree on the order.
        interval: of w, percentiles over resampled people. Chance alone makes w positive, so it
            does not reach 0.
    """

    test: str
    statistic: float
    freedom: int
    p: float
    w: float
    interval: Interval | NotComputable
    people: int
    conditions: int


def friedman(
    table: FloatArray,
    *,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> RankedConditions | NotComputable:
    """Friedman's test with the correction for ties, R's ``friedman.test``.

    Args:
        table: (people, conditions), complete.

    Raises:
        InvalidConfig: no such table, a value is not finite, or ``resamples`` or ``confidence`` is
            outside what it may be.
    """
    return _ranked("Friedman", checked_table("table", table), rng, resamples, confidence)


def cochran_q(
    success: FloatArray,
    *,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> RankedConditions | NotComputable:
    """Cochran's Q, which is Friedman's test of zeros and ones.

    Args:
        success: (people, conditions), 0 or 1.

    Raises:
        InvalidConfig: a value is neither; else see ``friedman``.
    """
    success = checked_table("success", success)
    if other := sorted(set(np.unique(success).tolist()) - {0.0, 1.0}):
        raise InvalidConfig(f"success has {other[0]:g}; it must be 0 or 1.")
    return _ranked("Cochran's Q", success, rng, resamples, confidence)


def _ranked(
    test: str, table: FloatArray, rng: np.random.Generator, resamples: int, confidence: float
) -> RankedConditions | NotComputable:
    checked_confidence(confidence)
    people, conditions = table.shape
    if missing := too_few(people):
        return missing
    ranks = rankdata(table, axis=1) - (conditions + 1) / 2.0
    within = np.square(ranks).sum(axis=1)  # what each person's ranks spread; less with ties
    if not within.any():
        return NotComputable(reason="nobody ranks one condition above another")
    counts = resample_counts(people, resamples, rng)
    spread = counts @ within
    if spread.all():
        resampled = np.square(counts @ ranks).sum(axis=1) / spread / people
        interval = percentile_interval(resampled, confidence)
    else:
        some = int(np.count_nonzero(within))
        interval = NotComputable(
            reason=f"only {some} of {people} people rank conditions apart, and resamples miss them"
        )
    w = float(np.square(ranks.sum(axis=0)).sum() / within.sum()) / people
    statistic = w * people * (conditions - 1)
    return RankedConditions(
        test=test,
        statistic=statistic,
        freedom=conditions - 1,
        p=float(chi2.sf(statistic, conditions - 1)),
        w=w,
        interval=interval,
        people=people,
        conditions=conditions,
    )
