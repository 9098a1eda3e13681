"""Populations: what is drawn, from what, and that no two people share a seed."""

import numpy as np
import pytest

from steerlab.sim import populations
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import sample_population


def test_pseudonyms_come_from_the_prefix():
    names = [teacher.name for teacher in sample_population("human", 3, 0, prefix="new")]
    assert names == ["new-000", "new-001", "new-002"]


@pytest.mark.parametrize("kind", ["paper", "low", "human", "high"])
def test_same_seed_same_people_and_more_people_keep_the_first(kind):
    few = sample_population(kind, 5, 4, prefix="seen")
    many = sample_population(kind, 9, 4, prefix="seen")
    assert few == many[:5]


def test_no_person_shares_a_style_or_a_noise_seed():
    people = [
        teacher
        for kind in ("low", "human")
        for seed in range(3)
        for prefix in ("seen", "new")
        for teacher in sample_population(kind, 34, seed, prefix=prefix)
    ]
    assert len({teacher.seed for teacher in people}) == len(people)
    assert len({teacher.style for teacher in people}) == len(people)


def test_styles_follow_the_stated_distributions():
    styles = [teacher.style for teacher in sample_population("human", 3000, 0, prefix="p")]
    log_gain = np.log([style.gain for style in styles])
    delay_s = np.array([style.delay_s for style in styles])
    lag_s = np.array([style.lag_s for style in styles])
    noise = np.array([style.signal_noise for style in styles])
    assert log_gain.mean() == pytest.approx(0.0, abs=0.03)
    assert log_gain.std() == pytest.approx(0.45, abs=0.03)
    assert delay_s.mean() == pytest.approx(0.12, abs=0.02)
    assert delay_s.std() == pytest.approx(0.22, abs=0.02)
    assert 0.05 <= lag_s.min() < lag_s.max() <= 0.25
    assert np.median(noise) == pytest.approx(0.25, rel=0.05)


def test_noise_grows_from_low_to_high():
    levels = (populations.LOW, populations.HUMAN, populations.HIGH)
    for name in ("constant_noise", "signal_noise", "dead_zone", "bias_std", "drift_std"):
        values = [getattr(level, name) for level in levels]
        assert values == sorted(values)
        assert len(set(values)) == 3


def test_paper_people_are_noise_free_and_over_or_under_correct():
    styles = [teacher.style for teacher in sample_population("paper", 200, 1, prefix="p")]
    assert {round(style.delay_s, 9) for style in styles} == {-0.3, 0.0, 0.3}
    assert all(abs(np.log(style.gain)) >= np.log(1.1) for style in styles)
    assert {style.gain > 1.0 for style in styles} == {True, False}
    assert {(s.constant_noise, s.signal_noise, s.lag_s, s.bias) for s in styles} == {(0, 0, 0, 0)}


@pytest.mark.parametrize(
    ("kind", "count", "seed", "prefix", "message"),
    [
        ("humans", 3, 0, "p", "'humans'; choose one of paper, low, human, high"),
        ("human", 0, 0, "p", "at least 1"),
        ("human", -4, 0, "p", "at least 1"),
        ("human", 3, -1, "p", "non-negative"),
        ("human", 3, 0, "", "prefix"),
    ],
)
def test_impossible_populations_are_refused(kind, count, seed, prefix, message):
    with pytest.raises(InvalidConfig, match=message):
        sample_population(kind, count, seed, prefix=prefix)
