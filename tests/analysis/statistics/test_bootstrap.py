"""Bootstrap intervals: reproducible, in the right place, and as wide as they claim."""

import numpy as np
import pytest

from steerlab.analysis.statistics.bootstrap import bootstrap_interval
from steerlab.sim.errors import InvalidConfig


def test_one_seed_gives_one_interval():
    rows = np.random.default_rng(0).standard_normal(20)
    first, second = (
        bootstrap_interval(rows, np.mean, rng=np.random.default_rng(3), resamples=499)
        for _ in range(2)
    )
    other = bootstrap_interval(rows, np.mean, rng=np.random.default_rng(4), resamples=499)
    assert first == second
    assert first != other


def test_both_methods_agree_with_the_normal_interval_of_a_mean(rng):
    rows = rng.standard_normal(400)
    half = 1.96 * rows.std(ddof=1) / 20.0
    for method in ("bca", "percentile"):
        found = bootstrap_interval(rows, np.mean, rng=rng, method=method)
        assert found.low == pytest.approx(rows.mean() - half, abs=0.01)
        assert found.high == pytest.approx(rows.mean() + half, abs=0.01)


def test_bca_leans_towards_the_long_tail(rng):
    rows = rng.standard_exponential(30) ** 2
    bca, percentile = (
        bootstrap_interval(rows, np.mean, rng=np.random.default_rng(1), method=method)
        for method in ("bca", "percentile")
    )
    assert bca.low > percentile.low
    assert bca.high > percentile.high


def test_people_are_drawn_whole(rng):
    """Each person's two values differ by 1, so the mean difference has no spread."""
    first = rng.standard_normal(12)
    rows = np.column_stack([first, first + 1.0])
    seen = []

    def difference(drawn):
        seen.append(float(np.ptp(drawn[:, 1] - drawn[:, 0])))
        return float(drawn.mean())

    bootstrap_interval(rows, difference, rng=rng, resamples=199)
    assert max(seen) < 1e-12


def test_an_unknown_method_is_refused(rng):
    with pytest.raises(InvalidConfig, match="bca or percentile"):
        bootstrap_interval(np.arange(5.0), np.mean, rng=rng, method="studentized")


@pytest.mark.slow
def test_the_interval_covers_as_often_as_it_says():
    hits, studies = 0, 600
    for seed in np.random.SeedSequence(6).spawn(studies):
        rng = np.random.default_rng(seed)
        rows = rng.standard_exponential(34)
        found = bootstrap_interval(rows, np.mean, rng=rng, resamples=499)
        hits += found.low <= 1.0 <= found.high
    assert 0.90 <= hits / studies <= 0.97  # BCa of a skewed mean falls a little short of 0.95
