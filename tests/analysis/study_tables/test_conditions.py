"""Conditions compared: the tests are those of the statistics, and a missing cell costs one person."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.analysis.statistics.omnibus import friedman
from steerlab.analysis.study_data.records import ConditionValue
from steerlab.analysis.study_tables.conditions import conditions, outcome_table
from steerlab.analysis.study_tables.plain import is_empty


def success_of(data) -> dict:
    return conditions(data, seed=0)["metrics"]["success"]


def test_the_last_round_is_tested(study, outcomes):
    values = outcomes(10)
    data = replace(study(4), conditions=values)
    found = success_of(data)
    last = {(o.person, o.condition): o.value for o in values if o.round == 2}
    names = ["mind_meld", "bc", "dagger"]
    table = np.array([[last[f"P{n + 1:03d}", name] for name in names] for n in range(10)])
    by_hand = friedman(table, rng=np.random.default_rng(0))
    assert found["friedman"]["statistic"] == pytest.approx(by_hand.statistic, rel=1e-5)
    assert found["means"]["bc"]["mean"] == pytest.approx(table[:, 1].mean(), rel=1e-5)
    assert found["mixed_model"]["order"] == "in the model"
    assert {one["name"] for one in found["mixed_model"]["coefficients"]} == {
        *("intercept", "bc", "dagger", "position")
    }
    assert [(p["first"], p["second"]) for p in found["pairs"]] == [
        ("mind_meld", "bc"), ("mind_meld", "dagger"), ("bc", "dagger"),
    ]  # fmt: skip
    assert "share of several drives" in found["binary"]["empty"]


def test_curves_have_every_round_with_an_interval(study, outcomes):
    found = success_of(replace(study(4), conditions=outcomes(10)))
    curve = found["curves"]["mind_meld"]
    assert [one["round"] for one in curve] == [0, 1, 2]
    for one in curve:
        low, high = one["ci95"]
        assert low <= one["mean"] <= high


def test_label_errors_are_means_over_rounds():
    values = [
        ConditionValue(person="P", condition="a", metric="label_mae", value=value, round=round_)
        for round_, value in ((0, 5.0), (1, 0.2), (2, 0.4))
    ]
    assert outcome_table(values, "label_mae") == {("P", "a"): (pytest.approx(0.3), None)}
    assert outcome_table(values, "success") == {("P", "a"): (0.4, None)}


def test_who_lacks_a_condition_is_named_and_left_out(study, outcomes):
    values = [o for o in outcomes(8) if (o.person, o.condition) != ("P003", "bc")]
    found = success_of(replace(study(4), conditions=tuple(values)))
    assert found["people"] == 7
    assert found["left_out"] == [{"person": "P003", "why": "no value under bc"}]
    assert found["mixed_model"]["rows"] == 8 * 3 - 1


def test_one_condition_alone_says_so(study, outcomes):
    values = tuple(o for o in outcomes(8) if o.condition == "bc")
    found = success_of(replace(study(4), conditions=values))
    assert found["friedman"] == found["pairs"]
    assert "nothing to compare" in found["friedman"]["empty"]
    assert not is_empty(found["means"]["bc"]["mean"])


def test_nobody_with_all_conditions_says_so(study, outcomes):
    values = tuple(o for o in outcomes(8) if (o.condition == "bc") == (o.person < "P005"))
    found = success_of(replace(study(4), conditions=values))
    assert found["friedman"] == {"empty": "nobody has a value under every condition"}


def test_three_people_are_too_few_and_it_is_said(study, outcomes):
    found = success_of(replace(study(4), conditions=outcomes(3)))
    assert "at least 4 are needed" in found["friedman"]["empty"]
    assert "at least 4 are needed" in found["pairs"][0]["test"]["empty"]


def test_yes_or_no_is_compared_by_cochran_and_mcnemar(study):
    rng = np.random.default_rng(2)
    values = tuple(
        ConditionValue(
            person=f"P{n:02d}",
            condition=name,
            metric="success",
            value=float(rng.random() < share),
        )
        for n in range(20)
        for name, share in (("mind-meld", 0.9), ("bc", 0.2))
    )
    found = success_of(replace(study(4), conditions=values))
    assert found["binary"]["cochran_q"]["p"] < 0.05
    assert found["binary"]["mcnemar"][0]["p_holm"] < 0.05
    assert found["curves"] == {"mind-meld": [], "bc": []}


def test_h4_needs_mind_meld_to_beat_each_rival(study, outcomes, tables_of):
    def verdict(**means: float) -> dict:
        values = outcomes(12, means=means)
        return tables_of(replace(study(4), conditions=values))["hypotheses"][-1]

    assert verdict(mind_meld=0.8, bc=0.3, dagger=0.5)["verdict"] == "supported"
    level = verdict(mind_meld=0.5, bc=0.2, dagger=0.5)
    assert level["p"] < 0.05
    assert level["verdict"] == "not supported"
    assert "not better than every rival" in level["note"]
    assert level["effect"]["what"] == "success, MIND MELD less DAgger, the closer rival"
    assert verdict(mind_meld=0.3, bc=0.6, dagger=0.8)["effect"]["value"] < 0.0
    assert "MIND MELD is not among" in verdict(bc=0.3, dagger=0.5)["p"]["empty"]
