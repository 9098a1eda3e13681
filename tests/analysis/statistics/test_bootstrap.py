"""Percentile bootstrap over people: reproducible, as scipy has it, and as wide as it claims."""

import numpy as np
import pytest
from scipy.stats import bootstrap

from steerlab.analysis.statistics.bootstrap import percentile_interval, resample_counts


def _interval(values, rng, resamples=4999):
    counts = resample_counts(len(values), resamples, rng)
    return percentile_interval(counts @ values / len(values), 0.95)


def test_one_seed_gives_one_interval():
    values = np.random.default_rng(0).standard_normal(20)
    first, again, other = (_interval(values, np.random.default_rng(n), 499) for n in (3, 3, 4))
    assert first == again
    assert first != other


def test_it_is_scipys_percentile_bootstrap(rng):
    values = rng.standard_exponential(30)
    found = _interval(values, rng)
    expected = bootstrap((values,), np.mean, n_resamples=4999, method="percentile", rng=rng)
    assert found.low == pytest.approx(expected.confidence_interval.low, abs=0.02)
    assert found.high == pytest.approx(expected.confidence_interval.high, abs=0.02)


def test_as_many_are_drawn_as_there_are():
    counts = resample_counts(7, 199, np.random.default_rng(0))
    assert counts.shape == (199, 7)
    assert (counts.sum(axis=1) == 7.0).all()


@pytest.mark.slow
def test_the_interval_covers_as_often_as_it_says():
    hits, studies = 0, 600
    for seed in np.random.SeedSequence(6).spawn(studies):
        rng = np.random.default_rng(seed)
        found = _interval(rng.standard_normal(34), rng, 499)
        hits += found.low <= 0.0 <= found.high
    assert 0.90 <= hits / studies <= 0.97  # percentiles fall a little short of 0.95
