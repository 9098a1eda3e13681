"""Small studies: what could not be tested is not called unsupported, and small numbers are not shown."""

import re
from dataclasses import replace

import pytest

from steerlab.analysis.study_data.conduct import Conduct, PhaseDuration, StepsKept
from steerlab.analysis.study_data.records import Exclusion
from steerlab.analysis.study_tables.deviations import deviations
from steerlab.analysis.study_tables.methods import methods_text
from steerlab.analysis.study_tables.report import AnalysisReport, render_analysis
from steerlab.analysis.study_tables.tables import Analysis, AnalysisConfig, analyse


def analysed(data, permutations: int = 199) -> Analysis:
    return analyse(data, AnalysisConfig(permutations=permutations))


def hypotheses(data, permutations: int = 199) -> dict[str, dict]:
    return {row["id"]: row for row in analysed(data, permutations).tables["hypotheses"]}


def page_of(analysis: Analysis) -> str:
    text = render_analysis(
        AnalysisReport(analysis=analysis, versions={}, seconds={}, command="x", files=())
    )
    text = re.sub(r"<style>.*?</style>|data:image[^\"]*", "", text, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text))


@pytest.mark.parametrize(("people", "smallest"), [(4, ".125"), (5, ".062")])
def test_h1_with_few_people_could_not_be_tested(people, smallest, study):
    """All labels got better, and still no p below .05 can come of it."""
    found = hypotheses(study(people))["H1"]
    assert found["verdict"] == "not testable"
    assert found["why"] == f"with {people} people the smallest p there can be is {smallest}"
    assert found["p"] == found["smallest_p"] > 0.05
    assert found["p_corrected"] == {"empty": found["why"]}
    assert found["power"]["of_medium"] == 0.0
    assert hypotheses(study(6))["H1"]["verdict"] == "supported"


def test_what_cannot_be_significant_costs_the_others_nothing(study, make_plan):
    found = hypotheses(replace(study(5), plan=make_plan()), 9999)
    tested = [row for row in found.values() if row["primary"] and row["verdict"] != "not testable"]
    assert found["H1"]["verdict"] == "not testable"
    assert len(tested) == 2
    assert max(row["p_corrected"] / row["p"] for row in tested) <= 2.0 + 1e-6


def test_too_few_permutations_for_several_scales_are_said(study):
    found = hypotheses(study(12), 19)
    assert found["H2a"]["why"].endswith("is .250 after Holm’s correction over 5 scales")
    assert found["H2a"]["why"].startswith("with 12 people and 19 permutations")
    assert found["H2b"]["why"].endswith("the smallest p there can be is .050")
    enough = hypotheses(study(12), 99)
    assert "why" not in enough["H2b"]


def test_after_correction_it_may_be_impossible_too(study, make_plan):
    """Each of three tests alone can be significant; by Holm the first of them needs p < .0167."""
    found = hypotheses(replace(study(6), plan=make_plan()), 49)
    assert found["H1"]["smallest_p"] == 0.03125
    assert found["H3a"]["smallest_p"] == 0.02
    for name, alone in (("H1", ".031"), ("H3a", ".020"), ("H3b", ".020")):
        assert found[name]["verdict"] == "not testable"
        assert found[name]["why"].endswith(f"can be is {alone}, and .060 after correction for 3 hypotheses")  # fmt: skip
    free = hypotheses(replace(study(6), plan=make_plan(correction="none")), 49)
    assert {free[name]["verdict"] for name in ("H1", "H3a")} == {"supported"}


def test_h4_needs_pairs_that_can_be_significant(study, outcomes):
    found = hypotheses(replace(study(4), conditions=outcomes(6)))["H4"]
    assert found["verdict"] == "not testable"
    assert "smallest p that a pair of conditions can have is .094" in found["why"]
    assert hypotheses(replace(study(4), conditions=outcomes(7)))["H4"]["verdict"] == "supported"


def test_one_reason_is_said_once_and_there_is_no_grid_of_numbers(study, make_plan):
    data = replace(study(3), plan=make_plan(), held_out=())
    analysis = analysed(data)
    page = page_of(analysis)
    assert page.count("people with w and a value: 3; at least 4 are needed") == 1
    assert "3 people have w and a value" in page
    assert "Correlations are shown from 20 people on" in page
    assert "w1" not in page
    said = deviations(data, analysis.tables["hypotheses"])
    assert sum("at least 4 are needed" in one for one in said) == 1
    assert any(one.startswith("H3a, H3b were planned and could not") for one in said)


def test_below_its_size_a_number_is_in_the_files_and_marked(study, outcomes):
    analysis = analysed(replace(study(12), conditions=outcomes(7)))
    tables, page = analysis.tables, page_of(analysis)
    row = tables["table2"]["rows"][0]
    assert row["too_few"] == "12 people; shown from 20"
    assert row["primary"]["r"] > 0.0
    assert "Pearson’s r, or" not in page.split("Methods")[0]
    alpha = tables["table1"][0]
    assert alpha["alpha_too_few"] == "12 people; shown from 30"
    assert isinstance(alpha["alpha"], float)
    assert "α is shown from 30 people on" in page
    point = tables["conditions"]["metrics"]["success"]["curves"]["bc"][0]
    assert point["too_few"] == "7 people; shown from 10"
    assert "Bands are drawn from 10 people on" in page
    assert tables["label_quality"]["seen"]["too_few"] is None


def test_methods_say_how_the_study_went(study):
    people = study(12, test_people=2)
    scripted = replace(people.people[0], steered_with=("scripted",))
    wheel = [replace(one, steered_with=("wheel",)) for one in people.people[1:]]
    conduct = Conduct(
        conditions=("mind_meld", "bc", "dagger"),
        block_size=6,
        seed=7,
        rounds=12,
        blind=True,
        condition_orders={("bc", "mind_meld", "dagger"): 2},
        rollouts=3,
        rollout_orders=1,
        phases=(
            PhaseDuration(
                title="Practice drive", times=13, median_s=372.0, shortest_s=61.0, longest_s=4000.0
            ),
        ),
        devices={"wheel: G29": 13, "scripted": 1},
        control_hz=(20.0,),
        steps=StepsKept(
            steps=9000, overruns=3, late_p50_ms=0.05, late_p99_ms=0.61, late_max_ms=8.2
        ),
        attempts=42,
        flags={"lateness_max_ms": 1},
    )
    data = replace(
        people,
        simulated=False,
        people=(scripted, *wheel),
        conduct=conduct,
        flagged=frozenset({("T002", "a")}),
        exclusions=tuple(
            Exclusion(what="person", who=who, why="did not consent") for who in ("T998", "T999")
        ),
    )
    text = dict(methods_text(analysed(data)))
    assert "1 of those analysed are scripts and no people (T001)" in text["Participants"]
    assert "Participants left out: 2 did not consent." in text["Participants"]
    assert "everyone in the same order" in text["Procedure"]
    assert "one of all 6, drawn from seed 7 in blocks of 6" in text["Procedure"]
    assert "The experimenter was not shown which condition" in text["Procedure"]
    assert "2 × BC, MIND MELD, DAgger" in text["Procedure"]
    assert "practice drive 6.2\u202fmin (61\u202fs to 66.7\u202fmin; 13 times)" in text["Procedure"]
    assert "Control steps came at 20 Hz" in text["Devices and timing"]
    assert "wheel: G29 (13)" in text["Devices and timing"]
    assert "measured for 0 of 13" in text["Devices and timing"]
    assert "99 % within 0.61 ms" in text["Devices and timing"]
    assert (
        "1 of 42 attempts broke a limit of timing (largest lateness (1))"
        in (text["Devices and timing"])
    )
