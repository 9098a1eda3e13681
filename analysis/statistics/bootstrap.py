"""Bootstrap intervals over people."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.stats import norm

from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked_confidence,
    too_few,
)
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

RESAMPLES = 4999
FEWEST_RESAMPLES = 199


def bootstrap_interval(
    rows: FloatArray,
    statistic: Callable[[FloatArray], float],
    *,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
    method: Literal["bca", "percentile"] = "bca",
) -> Interval | NotComputable:
    """Interval of ``statistic`` when the people, the rows of ``rows`` (n, ...), are drawn again.

    BCa (Efron 1987) corrects the percentiles for bias and skew. Keep what belongs to one person in
    one row, so that people are drawn, not single answers.

    Raises:
        InvalidConfig: ``method``, ``resamples`` or ``confidence`` is outside what it may be.
    """
    if method not in ("bca", "percentile"):
        raise InvalidConfig(f"No bootstrap {method!r}; choose bca or percentile.")
    if missing := too_few(len(rows)):
        return missing
    n = len(rows)
    checked_confidence(confidence)
    drawn = rng.integers(n, size=(_checked_resamples(resamples), n))
    found = np.array([statistic(rows[one]) for one in drawn])
    observed = float(statistic(rows))
    if not (np.isfinite(found).all() and np.isfinite(observed)):
        return NotComputable(reason="the statistic is not defined for some resamples")
    tails = np.array([(1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0])
    if method == "percentile":
        return percentile_interval(found, confidence)
    below = np.mean(found < observed) + np.mean(found == observed) / 2.0
    if not 0.0 < below < 1.0:
        return NotComputable(reason="every resample lies on one side of the statistic")
    left_out = np.array([statistic(np.delete(rows, at, axis=0)) for at in range(n)])
    if not np.isfinite(left_out).all():
        return NotComputable(reason="the statistic is not defined without one of the people")
    apart = left_out.mean() - left_out
    spread = np.square(apart).sum()
    if spread == 0.0:
        return NotComputable(reason="the statistic is the same whoever is left out")
    acceleration = (apart**3).sum() / (6.0 * spread**1.5)
    bias = norm.ppf(below)
    shifted = bias + norm.ppf(tails)
    low, high = np.quantile(found, norm.cdf(bias + shifted / (1.0 - acceleration * shifted)))
    return Interval(low=float(low), high=float(high), confidence=confidence)


def percentile_interval(found: FloatArray, confidence: float) -> Interval:
    """The middle of resampled statistics (resamples,)."""
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(found, [tail, 1.0 - tail])
    return Interval(low=float(low), high=float(high), confidence=confidence)


def resample_counts(people: int, resamples: int, rng: np.random.Generator) -> FloatArray:
    """How often each person is drawn, (resamples, people); for statistics that are sums.

    Raises:
        InvalidConfig: too few resamples for a tail.
    """
    shares = np.full(people, 1.0 / people)
    return rng.multinomial(people, shares, size=_checked_resamples(resamples)).astype(np.float64)


def _checked_resamples(resamples: int) -> int:
    if resamples < FEWEST_RESAMPLES:
        raise InvalidConfig(f"resamples is {resamples}; a tail needs {FEWEST_RESAMPLES} or more.")
    return resamples
