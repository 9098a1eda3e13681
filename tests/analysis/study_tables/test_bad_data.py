"""Whatever is missing or degenerate, the report is made and the cell says why it is empty."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from steerlab.analysis.study_data.records import Embeddings, Exclusion, StudyData
from steerlab.analysis.study_tables.csv_files import csv_files
from steerlab.analysis.study_tables.plain import is_empty
from steerlab.analysis.study_tables.report import AnalysisReport, render_analysis
from steerlab.analysis.study_tables.tables import Analysis, AnalysisConfig, analyse


def _page(analysis: Analysis) -> str:
    return render_analysis(
        AnalysisReport(
            analysis=analysis,
            versions={"steerlab": "0"},
            seconds={},
            command="steerlab analyze x",
            files=tuple(csv_files(analysis.tables)),
        )
    )


def _text(page: str) -> str:
    """What a reader sees: no style, no pictures, no tags."""
    page = re.sub(r"<style>.*?</style>|data:image[^\"]*", "", page, flags=re.DOTALL)
    return re.sub(r"<[^>]+>", " ", page)


def _without_answers(data: StudyData) -> StudyData:
    people = tuple(replace(one, answers={key: {} for key in one.answers}) for one in data.people)
    return replace(data, people=people)


def _identical_answers(data: StudyData) -> StudyData:
    def same(answers):
        return {key: dict.fromkeys(given, 3) if key != "demographics" else given
                for key, given in answers.items()}  # fmt: skip

    return replace(
        data, people=tuple(replace(one, answers=same(one.answers)) for one in data.people)
    )


def _constant_w(data: StudyData) -> StudyData:
    one = data.embeddings[0]
    return replace(data, embeddings=(replace(one, w=np.ones_like(one.w)),))


def _constant_labels(data: StudyData) -> StudyData:
    return replace(
        data, series=tuple(replace(one, label=np.zeros_like(one.label)) for one in data.series)
    )


def _masked(data: StudyData) -> StudyData:
    nothing = np.zeros_like(data.series[0].valid)
    return replace(data, series=tuple(replace(one, valid=nothing) for one in data.series))


CASES: dict[str, tuple[int, Callable[[StudyData], StudyData], str]] = {
    "three people": (3, lambda data: data, "at least"),
    "nobody": (
        4,
        lambda data: StudyData(kind="study", title="Empty", simulated=False, people=(), series=()),
        "no network was trained",
    ),
    "identical answers": (30, _identical_answers, "everyone has the same score"),
    "missing questionnaires": (12, _without_answers, "nobody answered all its items"),
    "never asked": (
        12,
        lambda data: replace(data, people=tuple(replace(one, answers={}) for one in data.people)),
        "nobody was asked a questionnaire with a scale",
    ),
    "constant embedding": (12, _constant_w, "all values of dimension 0 are 1"),
    "no network": (12, lambda data: replace(data, embeddings=(), held_out=()), "no network"),
    "constant labels": (12, _constant_labels, "all values of the labels are 0"),
    "no valid step": (12, _masked, "valid steps: 0"),
    "no error to remove": (
        12,
        lambda data: replace(
            data,
            held_out=tuple(
                replace(one, before=0.0 * one.before, after=0.0 * one.after)
                for one in data.held_out
            ),
        ),
        "no improvement is defined",
    ),
    "left out and withdrawn": (
        12,
        lambda data: replace(
            data,
            exclusions=(
                Exclusion(what="person", who="T999", why="withdrew, and their data are erased"),
                Exclusion(what="attempt", who="attempt 0", why="abandoned: restarted"),
            ),
        ),
        "withdrew, and their data are erased",
    ),
    "all flagged": (
        12,
        lambda data: replace(
            data, flagged=frozenset((one.person, one.rollout) for one in data.series)
        ),
        "people with unflagged attempts: 0",
    ),
    "flagged, and no network": (
        12,
        lambda data: replace(
            data,
            flagged=frozenset({(data.series[0].person, data.series[0].rollout)}),
            embeddings=(),
        ),
        "Without them:  there is no embedding",
    ),
    "one gender": (
        20,
        lambda data: replace(
            data,
            people=tuple(
                replace(one, answers={**one.answers, "demographics": {"gender": "woman"}})
                for one in data.people
            ),
        ),
        "people in the smaller group: 0",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_report_is_made_and_says_why(case, study, monkeypatch):
    monkeypatch.setattr("steerlab.analysis.page.svg_data_uri", lambda figure: "data:,")
    people, change, reason = CASES[case]
    analysis = analyse(change(study(people)), AnalysisConfig(permutations=99))
    page = _page(analysis)
    text = _text(page)
    assert reason in text
    for shown in (text, analysis.to_json(), *csv_files(analysis.tables).values()):
        assert not re.search(r"\b(nan|NaN|None|inf)\b", shown)


def test_identical_answers_leave_alpha_empty_and_the_mean_there(study):
    rows = analyse(_identical_answers(study(12)), AnalysisConfig(permutations=99)).tables["table1"]
    for row in rows:
        assert is_empty(row["alpha"])
        assert is_empty(row["alpha_ci95"])
        assert row["sd"] == 0.0
    assert not is_empty(rows[0]["mean"])


def test_one_missing_answer_costs_one_person_one_scale(study, tables_of):
    data = study(12)
    first = data.people[0]
    given = dict(first.answers["mini_ipip_5"])
    del given["i01"]
    changed = replace(first, answers={**first.answers, "mini_ipip_5": given})
    tables = tables_of(replace(data, people=(changed, *data.people[1:])))
    people = {row["scale"]: row["people"] for row in tables["table1"]}
    assert people["extraversion"] == 11
    assert people["openness"] == 12
    assert tables["exclusions"]["rows"] == [
        {
            "what": "values",
            "who": first.id,
            "why": "counts, but has no value of Extraversion (no answer to i01)",
        }
    ]
    found = {row["key"]: row["people"] for row in tables["table2"]["rows"]}
    assert found["mini_ipip_5.extraversion"] == 11
    assert found["mini_ipip_5.openness"] == 12


def test_who_is_in_no_network_is_counted_as_left_out(study, tables_of):
    data = study(12)
    one = data.embeddings[0]
    few = Embeddings(seed=0, source="x", people=one.people[:9], w=one.w[:9], held_out=("c",))
    rows = tables_of(replace(data, embeddings=(few,)))["table2"]["rows"]
    assert {row["people"] for row in rows} == {9}


def test_an_embedding_of_another_length_is_refused():
    from steerlab.sim.errors import InvalidConfig

    with pytest.raises(InvalidConfig, match=r"\(3, 2\) for 2 people"):
        Embeddings(seed=0, source="x", people=("a", "b"), w=np.zeros((3, 2)))


def _with_gaps(data: StudyData, rng: np.random.Generator) -> StudyData:
    """Answers, steps, attempts, people of a network and outcomes missing at random."""

    def some(values, share: float = 0.8) -> tuple:
        return tuple(one for one in values if rng.random() < share)

    people = tuple(
        replace(
            one,
            answers={
                key: {item: given[item] for item in some(given, 0.97)}
                for key, given in one.answers.items()
                if rng.random() < 0.9
            },
        )
        for one in data.people
    )
    series = tuple(
        replace(one, valid=one.valid & (rng.random(one.steps) < rng.choice([1.0, 0.03])))
        for one in some(data.series)
    )
    networks = tuple(
        replace(one, people=one.people[:count], w=one.w[:count] * rng.choice([1.0, 0.0, 1e-30]))
        for one in some(data.embeddings)
        if (count := int(rng.integers(1, len(one.people) + 1)))
    )
    held_out = tuple(
        replace(one, before=one.before * (rng.random(len(one.people)) < 0.5))
        for one in some(data.held_out)
    )
    return replace(
        data,
        people=people,
        series=series,
        embeddings=networks,
        held_out=held_out,
        conditions=some(data.conditions, 0.85),
        flagged=frozenset((one.person, one.rollout) for one in some(series, 0.3)),
    )


@pytest.mark.parametrize("seed", range(12))
def test_any_mix_of_gaps_leaves_a_report_without_nan(seed, study, outcomes, monkeypatch):
    monkeypatch.setattr("steerlab.analysis.page.svg_data_uri", lambda figure: "data:,")
    rng = np.random.default_rng(seed)
    whole = study(int(rng.integers(2, 14)), test_people=int(rng.integers(0, 4)), seed=seed)
    values = outcomes(int(rng.integers(1, 8)), seed=seed) if seed % 4 else ()
    data = _with_gaps(replace(whole, conditions=values), rng)
    analysis = analyse(data, AnalysisConfig(permutations=19))
    shown = (_text(_page(analysis)), analysis.to_json(), *csv_files(analysis.tables).values())
    assert not any(re.search(r"\b(nan|NaN|None|inf)\b", text) for text in shown)
