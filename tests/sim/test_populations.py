"""Populations: what is drawn, from what, and that no two people share a seed."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from steerlab.sim import populations
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind, sample_population

GOLDEN = [(0.421302, -0.3), (0.935115, 0.097954), (1.116034, 0.177737), (0.875304, -0.075895)]


def test_pseudonyms_come_from_the_prefix():
    names = [teacher.name for teacher in sample_population("human", 3, 0, prefix="new")]
    assert names == ["new-000", "new-001", "new-002"]


@pytest.mark.parametrize("kind", get_args(PopulationKind))
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


def test_earlier_populations_are_not_redrawn():
    """Rounded values of before there were ``people`` and ``sparse``."""
    drawn = [sample_population(k, 1, 0, prefix="p")[0] for k in ("paper", "low", "human", "high")]
    found = [(round(one.style.gain, 6), round(one.style.delay_s, 6)) for one in drawn]
    assert found == GOLDEN


def test_people_are_as_they_were_measured():
    drawn = sample_population("people", 3000, 0, prefix="p")
    delay_s = np.array([one.style.delay_s for one in drawn])
    blind = delay_s > 0.27  # three standard deviations from either half's mean
    assert blind.mean() == pytest.approx(0.5, abs=0.03)
    assert (delay_s[blind].mean(), delay_s[blind].std()) == pytest.approx((0.36, 0.03), abs=0.005)
    assert delay_s[~blind].mean() == pytest.approx(0.01, abs=0.01)
    assert delay_s[~blind].std() == pytest.approx(0.09, abs=0.01)
    assert 0.05 < np.log([one.style.gain for one in drawn]).std() < 0.09
    rms = populations.ORACLE_RMS
    noise = np.array([one.style.constant_noise for one in drawn])
    assert 0.22 * rms <= noise.min() < 0.23 * rms
    assert 0.43 * rms < noise.max() <= 0.44 * rms
    times_s = [one.style.noise_time_s for one in drawn]
    assert 0.7 <= min(times_s) < max(times_s) <= 1.0
    assert {one.style.signal_noise for one in drawn} == {0.0}
    assert delay_s.mean() == pytest.approx(populations.PEOPLE.delay_mean_s, abs=0.01)
    assert delay_s.std() == pytest.approx(populations.PEOPLE.delay_std_s, abs=0.005)


def test_the_unit_of_peoples_noise_is_the_calibration_sets():
    truth = np.concatenate([one.oracle_label[one.oracle_valid] for one in load_calibration_set()])
    assert np.sqrt(np.mean(truth**2)) == pytest.approx(populations.ORACLE_RMS, abs=0.01)


def test_sparse_people_are_human_but_rest_for_half_of_the_calibration_set():
    rollouts = load_calibration_set()
    apart = np.concatenate(
        [np.abs(one.oracle_label - one.robot_wheel)[one.oracle_valid] for one in rollouts]
    )
    assert (apart <= 0.5).mean() == pytest.approx(0.54, abs=0.01)
    sparse = sample_population("sparse", 40, 0, prefix="p")
    tolerances = [one.style.tolerance for one in sparse]
    assert np.mean(tolerances) == pytest.approx(0.5, abs=0.05)
    assert 0.3 <= min(tolerances) < max(tolerances) <= 0.7
    rests, agrees = [], []
    for one in sparse:
        always = replace(one, style=replace(one.style, tolerance=0.0))
        for order, rollout in enumerate(rollouts):
            label = one.respond(rollout, order=order, attempt=0)
            rests.append(label == 0.0)
            agrees.append(label == always.respond(rollout, order=order, attempt=0))
    assert 0.45 < np.concatenate(rests).mean() < 0.58
    assert np.concatenate(agrees).mean() < 0.5


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
        ("humans", 3, 0, "p", "'humans'; choose one of paper, low, human, high, people, sparse"),
        ("human", 0, 0, "p", "at least 1"),
        ("human", -4, 0, "p", "at least 1"),
        ("human", 3, -1, "p", "non-negative"),
        ("human", 3, 0, "", "prefix"),
    ],
)
def test_impossible_populations_are_refused(kind, count, seed, prefix, message):
    with pytest.raises(InvalidConfig, match=message):
        sample_population(kind, count, seed, prefix=prefix)
