"""Percentile bootstrap over people, for means and for ratios of sums over people.

People are drawn, each with all of their answers, not single answers. Counts in place of rows make
the resampled sums one product of matrices.
"""

import numpy as np

from steerlab.analysis.statistics.outcome import ConfidenceInterval
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

RESAMPLES = 4999
FEWEST_RESAMPLES = 199


def resample_counts(people: int, resamples: int, rng: np.random.Generator) -> FloatArray:
    """How often each person is drawn, (resamples, people); each row sums to ``people``.

    Raises:
        InvalidConfig: too few resamples for a tail.
    """
    if resamples < FEWEST_RESAMPLES:
        raise InvalidConfig(f"resamples is {resamples}; a tail needs {FEWEST_RESAMPLES} or more.")
    shares = np.full(people, 1.0 / people)
    return rng.multinomial(people, shares, size=resamples).astype(np.float64)


def percentile_interval(resampled: FloatArray, confidence: float) -> ConfidenceInterval:
    """The interval that holds the middle ``confidence`` of resampled statistics (resamples,)."""
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(resampled, [tail, 1.0 - tail])
    return ConfidenceInterval(low=float(low), high=float(high), confidence=confidence)


def mean_interval(
    values: FloatArray, rng: np.random.Generator, *, resamples: int = RESAMPLES
) -> ConfidenceInterval:
    """95 % interval of the mean of ``values`` (people,), one of each person."""
    means = resample_counts(len(values), resamples, rng) @ values / len(values)
    return percentile_interval(means, 0.95)
