"""Before and after a lesson: people's errors in the first correcting phase against those in the last."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.analysis.study_data.records import PlannedHypothesis
from steerlab.analysis.study_tables.deviations import deviations

HALVES = (("a",), ("c",))


def taught(data, *, share_left: float, turned: bool):
    """Everybody corrects two parts; in the second, so much of their error is left."""
    people = tuple(
        replace(person, parts=HALVES[::-1] if turned and number % 2 else HALVES)
        for number, person in enumerate(data.people)
    )
    last = {person.id: person.parts[-1] for person in people}
    series = tuple(
        replace(one, label=np.clip(one.truth + share_left * (one.label - one.truth), -2.5, 2.5))
        if one.rollout in last[one.person]
        else one
        for one in data.series
        if one.rollout != "b"
    )
    return replace(data, people=people, series=series)


def pre_post(tables) -> dict:
    return next(row for row in tables["hypotheses"] if row["id"] == "PrePost")


def test_a_lesson_that_halves_the_errors_is_found(study, tables_of):
    data = taught(study(16), share_left=0.5, turned=True)
    row = pre_post(tables_of(data))
    errors = {(s.person, s.rollout): abs(s.label - s.truth)[s.valid].mean() for s in data.series}
    falls = sorted(
        errors[one.id, one.parts[0][0]] - errors[one.id, one.parts[1][0]] for one in data.people
    )
    assert row["verdict"] == "supported"
    assert row["n"] == 16
    assert falls[4] < row["effect"]["value"] < falls[-4]
    assert "note" not in row


def test_a_lesson_that_spoils_is_not_called_a_success(study, tables_of):
    row = pre_post(tables_of(taught(study(16), share_left=2.0, turned=True)))
    assert (row["verdict"], row["note"]) == ("not supported", "the corrections got worse")
    assert row["p_corrected"] < 0.05


def test_without_turns_it_is_said_that_the_drives_may_differ(study, tables_of):
    row = pre_post(tables_of(taught(study(16), share_left=0.5, turned=False)))
    assert row["note"].startswith("everybody had the same drives first")


def test_it_is_asked_only_where_there_are_parts_or_a_plan(study, tables_of, make_plan):
    assert "PrePost" not in {row["id"] for row in tables_of(study(8))["hypotheses"]}
    planned = PlannedHypothesis(
        id="PrePost",
        text="Better.",
        outcome="mean absolute error of labels against the ground truth, after less before, per person",
        test="paired, before against after",
        primary=True,
    )
    data = replace(study(8), plan=make_plan(hypotheses=(planned,)))
    row = pre_post(tables_of(data))
    assert row["why"] == "everybody corrected all drives in one phase"
    with_parts = taught(data, share_left=0.5, turned=True)
    rows = tables_of(with_parts)["hypotheses"]
    assert not [said for said in deviations(with_parts, rows) if said.startswith("PrePost")]


@pytest.mark.parametrize("people", [4, 5])
def test_too_few_people_leave_it_untested(people, study, tables_of):
    row = pre_post(tables_of(taught(study(people), share_left=0.5, turned=True)))
    assert row["verdict"] == "not testable"
