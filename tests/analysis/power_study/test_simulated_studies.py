"""Simulated studies: a null rejects at its level, what is planted is found as theory says."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.analysis.power_study.design import ConditionMean, Effect, PowerDesign
from steerlab.analysis.power_study.simulated_studies import (
    ANY_NULL,
    BETTER,
    BLOCK,
    DIFFER,
    HOLM,
    NULL,
    friedman_p,
    multiple_p,
    reject_correlations,
    reject_outcomes,
    resample_outcomes,
    rivals_of,
    run_block,
    simulate_correlations,
    simulate_outcomes,
)
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.statistics.noncentral import multiple_power
from steerlab.analysis.statistics.omnibus import friedman
from steerlab.sim.errors import InvalidConfig

ALPHA = 0.05
STUDIES = 2000
ERROR = 3.0 * np.sqrt(ALPHA * (1.0 - ALPHA) / STUDIES)


def test_the_f_test_is_multiple_correlations_own():
    rng = np.random.default_rng(0)
    w, score = rng.standard_normal((5, 20, 3)), rng.standard_normal((5, 20))
    expected = [
        multiple_correlation(one, y, rng=rng, permutations=19).f_p
        for one, y in zip(w, score, strict=True)
    ]
    assert multiple_p(w, score).tolist() == pytest.approx(expected)


def test_for_normal_scores_f_and_permutation_agree():
    rng = np.random.default_rng(9)
    w, score = rng.standard_normal((12, 34, 4)), rng.standard_normal((12, 34))
    score[6:] += 0.8 * w[6:, :, 0]
    permuted = [
        multiple_correlation(one, y, rng=rng, permutations=1999).p
        for one, y in zip(w, score, strict=True)
    ]
    assert np.abs(multiple_p(w, score) - permuted).max() < 0.05


def test_friedman_of_many_studies_is_friedman_of_each():
    rng = np.random.default_rng(1)
    outcomes = rng.integers(0, 4, (30, 8, 3)) / 3.0
    expected = [friedman(one, rng=rng, resamples=199).p for one in outcomes]
    assert friedman_p(outcomes).tolist() == pytest.approx(expected)
    assert friedman_p(np.ones((2, 8, 3))).tolist() == [1.0, 1.0]


def test_a_null_study_rejects_at_its_level():
    design = PowerDesign(people=(34,))
    found = reject_correlations(
        simulate_correlations(design, 34, STUDIES, np.random.default_rng(2)), ALPHA
    )
    assert abs(found[NULL].mean() - ALPHA) < ERROR
    assert found[ANY_NULL].mean() < ALPHA + ERROR  # nine nulls of eleven tests: Holm bounds any


def test_equal_conditions_differ_at_the_level():
    same = tuple(ConditionMean(name=name, success=0.5) for name in ("mind_meld", "bc", "dagger"))
    design = PowerDesign(people=(34,), conditions=same)
    outcomes = simulate_outcomes(design, 34, STUDIES, np.random.default_rng(3))
    p = friedman_p(outcomes)
    assert abs(np.mean(p < ALPHA) - ALPHA) < ERROR + 0.005  # chi² is approximate among ties
    assert outcomes.min() >= 0.0
    assert outcomes.max() <= 1.0


def test_a_planted_correlation_has_the_power_that_theory_gives():
    effect = Effect(scale="a", style="gain", r=0.6)
    design = PowerDesign(people=(34,), effects=(effect,), reliability=0.8)
    p = simulate_correlations(design, 34, STUDIES, np.random.default_rng(4))
    # What w can explain of the score: the style's share of the trait, as far as w holds it.
    r = 0.6 * np.sqrt(0.8 * design.holding.w_gain)
    assert np.mean(p["a"] < ALPHA) == pytest.approx(multiple_power(r, 34, 4), abs=0.05)


def test_fewer_rollouts_and_more_noise_cost_power():
    effect = Effect(scale="a", style="delay", r=0.6)

    def power(**changes) -> float:
        design = replace(PowerDesign(people=(34,), effects=(effect,)), **changes)
        p = simulate_correlations(design, 34, STUDIES, np.random.default_rng(5))
        return float(np.mean(p["a"] < ALPHA))

    assert power(rollouts=1) < power()
    assert power(reliability=0.3) < power()


def test_corrected_rejections_are_among_the_uncorrected():
    effect = Effect(scale="a", style="gain", r=0.5)
    design = PowerDesign(people=(50,), effects=(effect,))
    found = reject_correlations(
        simulate_correlations(design, 50, 200, np.random.default_rng(6)), ALPHA
    )
    assert not (found["a" + HOLM] & ~found["a"]).any()
    assert found["a" + HOLM].sum() < found["a"].sum()


def test_the_better_condition_is_found_and_the_worse_is_not():
    rng = np.random.default_rng(7)
    names = ("mind_meld", "bc", "dagger")
    means = tuple(
        ConditionMean(name=n, success=s) for n, s in zip(names, (0.8, 0.4, 0.5), strict=True)
    )
    design = PowerDesign(people=(30,), conditions=means)
    outcomes = simulate_outcomes(design, 30, 60, rng)
    assert reject_outcomes(outcomes, names, "mind_meld", ALPHA)[BETTER].mean() > 0.9
    assert reject_outcomes(outcomes, names, "bc", ALPHA)[BETTER].mean() == 0.0
    assert reject_outcomes(outcomes, names, "bc", ALPHA)[DIFFER].mean() > 0.9


def test_an_oracle_is_no_rival():
    assert rivals_of(("bc", "oracle", "mind-meld", "dagger"), "mind-meld") == ["bc", "dagger"]
    assert rivals_of(("a", "oracle", "b"), "a") == ["b"]


def test_taught_people_are_drawn_whole():
    table = np.array([[0.0, 1.0], [0.5, 0.6]])
    drawn = resample_outcomes(table, 5, 3, np.random.default_rng(8))
    assert drawn.shape == (3, 5, 2)
    assert {tuple(row) for row in drawn.reshape(-1, 2).tolist()} <= {(0.0, 1.0), (0.5, 0.6)}


def test_a_block_depends_on_its_place_alone():
    design = PowerDesign(people=(12, 20))
    assert run_block(design, 12, 0, None) == run_block(replace(design, people=(12,)), 12, 0, None)
    assert run_block(design, 12, 0, None) != run_block(design, 12, 1, None)
    assert all(0 <= count <= BLOCK for count in run_block(design, 12, 0, None).values())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"people": ()}, "rising"),
        ({"people": (34, 12)}, "rising"),
        ({"people": (6,)}, "4 dimensions need 7"),
        ({"noise": "loud"}, "choose one of"),
        ({"studies": 10}, "studies is 10"),
        ({"family": 1}, "family is 1"),
        ({"reliability": 1.0}, "between 0 and 1"),
        ({"person_sd": -1.0}, "at least 0"),
        ({"conditions": (ConditionMean(name="a", success=0.5),)}, "two or more"),
        (
            {"conditions": tuple(ConditionMean(name=n, success=0.5) for n in "ab")},
            "must be one of a, b",
        ),
        ({"effects": (Effect(scale="a", style="gain", r=0.5),) * 2}, "keep one"),
        (
            {
                "effects": (
                    Effect(scale="a", style="gain", r=0.9),
                    Effect(scale="a", style="delay", r=0.9),
                )
            },
            "more than all of it",
        ),
    ],
)
def test_a_nonsensical_design_is_refused(changes, said):
    with pytest.raises(InvalidConfig, match=said):
        PowerDesign(**changes)


@pytest.mark.parametrize(
    "text", ["x", "a:gain", "a:speed:0.3", "a:gain:2", "a:gain:nan", ":gain:0.1"]
)
def test_what_is_no_effect_is_refused(text):
    with pytest.raises(InvalidConfig, match="SCALE:STYLE:R"):
        Effect.parse(text)


@pytest.mark.parametrize("text", ["x", "a:", "a:1", "a:0", "a:nan"])
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(InvalidConfig, match="NAME:SHARE"):
        ConditionMean.parse(text)
