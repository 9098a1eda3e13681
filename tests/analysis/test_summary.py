"""The summary: stable JSON, and errors that name the place."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.analysis.summary import InvalidSummary, SplitSummary, StyleSummary, Summary
from steerlab.learning.label_quality import label_quality
from steerlab.sim.errors import InvalidConfig, InvalidValue

finite = st.floats(-1e6, 1e6)
shares = st.floats(0, 1)

splits = st.builds(
    SplitSummary,
    people=st.integers(1, 1000),
    labels=st.integers(1, 10**6),
    mae_before=finite,
    mae_after=finite,
    improvement=st.fixed_dictionaries({"identity": finite, "mind_meld": finite}),
    ci95=st.tuples(finite, finite).map(lambda pair: (min(pair), max(pair))),
    person_median=finite,
    people_improved=shares,
    labels_worsened=shares,
    per_sample_percent=finite,
)
styles = st.builds(
    StyleSummary, probe_r2=st.none() | finite, spearman_new=st.none() | st.floats(-1, 1)
)
summaries = st.builds(
    Summary,
    seed=st.integers(0, 2**63),
    noise=st.text(max_size=5).filter(str.isprintable),
    versions=st.dictionaries(st.text("abc", min_size=1), st.text("0123.")),
    seconds=st.dictionaries(st.text("abc", min_size=1), st.floats(0, 1e6)),
    splits=st.fixed_dictionaries({"new": splits, "seen": splits}),
    style=st.fixed_dictionaries({"delay": styles, "gain": styles}),
    left_out=st.dictionaries(st.text("xyz", min_size=1), st.text("abc")),
)


@given(summaries)
def test_json_round_trip_up_to_rounding(summary: Summary):
    text = summary.to_json()
    again = Summary.from_json(text)
    assert again.to_json() == text
    assert again.splits["new"].mae_before == pytest.approx(
        summary.splits["new"].mae_before, abs=1e-6
    )


def test_key_order_does_not_depend_on_how_it_was_built(summary: Summary):
    turned = replace(
        summary,
        splits=dict(reversed(summary.splits.items())),
        style=dict(reversed(summary.style.items())),
        versions=dict(reversed(summary.versions.items())),
        left_out=dict(reversed(summary.left_out.items())),
    )
    assert turned.to_json() == summary.to_json()
    assert [*json.loads(summary.to_json())] == [
        "schema",
        "verb",
        "seed",
        "noise",
        "versions",
        "seconds",
        "splits",
        "left_out",
        "style",
    ]


def test_durations_and_versions_are_kept_apart(summary: Summary):
    slower = replace(summary, seconds={"fit": 99.0}, versions={"torch": "9"})
    assert slower.to_json() != summary.to_json()
    assert slower.reproducible() == summary.reproducible()
    assert replace(summary, seed=1).reproducible() != summary.reproducible()


def test_numpy_numbers_and_minus_zero_become_plain(summary: Summary):
    new = replace(
        summary.splits["new"], people=np.int64(3), mae_after=np.float32(0.5), person_median=-1e-9
    )
    values = json.loads(replace(summary, splits={**summary.splits, "new": new}).to_json())
    assert values["splits"]["new"]["people"] == 3
    assert values["splits"]["new"]["mae_after"] == 0.5
    assert math.copysign(1.0, values["splits"]["new"]["person_median"]) == 1.0


def put(values: Any, place: str, value: Any) -> None:
    *path, last = place.split(".")
    for part in path:
        values = values[part]
    values[last] = value


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("schema", 2, r"\$\.schema is 2; it must be 1, the only one that this steerlab reads"),
        ("schema", "1", r"\$\.schema is '1'; it must be 1, "),
        ("seed", 0.5, r"\$\.seed is 0\.5; it must be a whole number"),
        ("seed", True, r"\$\.seed is True; it must be a whole number"),
        ("noise", None, r"\$\.noise is None; it must be a text"),
        ("versions", [], r"\$\.versions is \[\]; it must be a table"),
        ("versions.torch", 2, r"\$\.versions\.torch is 2; it must be a text"),
        ("seconds.fit", "1 s", r"\$\.seconds\.fit is '1 s'; it must be a finite number"),
        ("splits.new.people", 0, r"\$\.splits\.new\.people is 0; it must be 1 or more"),
        ("splits.new.mae_after", float("nan"), r"\$\.splits\.new\.mae_after is nan"),
        (
            "splits.seen.ci95",
            [0.1],
            r"\$\.splits\.seen\.ci95 is \[0\.1\]; .* a list of 2: a finite",
        ),
        ("splits.seen.ci95", [0.1, "x"], r"\$\.splits\.seen\.ci95\[1\] is 'x'; .*finite number"),
        ("splits.seen.ci95", [0.7, 0.1], r"\$\.splits\.seen\.ci95 is .* the lower limit first"),
        ("splits.new.people_improved", 34, r"new\.people_improved is 34.*a share, from 0 to 1"),
        ("splits.new.improvement", {"identity": 0}, r"\$\.splits\.new\.improvement .*'mind_meld'"),
        ("splits.new.improvement.extra", 0.1, r"\$\.splits is \['extra'\]; .*of both splits"),
        ("splits.new.typo", 1, r"\$\.splits\.new\.typo is 1; it must be under one of .* people, "),
        ("splits.old", {}, r"\$\.splits\.old\.people is missing; give a whole number"),
        ("style.gain.probe_r2", "high", r"\$\.style\.gain\.probe_r2 is 'high'; .*finite number"),
        ("left_out.no_embedding", 1, r"\$\.left_out\.no_embedding is 1; it must be a text"),
        ("left_out.mind_meld", "why", r"\$\.left_out\.mind_meld is 'why'; .*not judged"),
        ("extra", 1, r"\$\.extra is 1; it must be under one of the keys schema, seed, "),
        ("splits", {}, r"\$\.splits is \[\]; it must be of new and seen"),
        ("noise", ["x" * 99], r"\$\.noise is \['x+\.\.\.; it must be a text"),
    ],
)
def test_what_is_wrong_is_named(summary: Summary, place: str, value: object, message: str):
    values = json.loads(summary.to_json())
    put(values, place, value)
    with pytest.raises(InvalidValue, match=message):
        Summary.from_json(json.dumps(values))


@pytest.mark.parametrize("text", ["", "{", '{"seed": 1, "seed": 2}', "[]", "null", '"summary"'])
def test_a_text_that_is_no_summary(text: str):
    with pytest.raises(InvalidConfig, match=r"no JSON|must be a table"):
        Summary.from_json(text)


def test_a_split_is_that_of_mind_meld_with_everyones_improvement():
    rng = np.random.default_rng(0)
    person = np.repeat(["a", "b", "c"], 4)
    raw, truth = rng.normal(size=12), rng.normal(size=12)
    ladder = {
        name: label_quality(person, raw, mapped, truth, np.random.default_rng(1))
        for name, mapped in (("identity", raw), ("mind_meld", 0.5 * (raw + truth)))
    }
    split = SplitSummary.of(ladder, unit=40.0)
    assert split.mae_before == pytest.approx(40.0 * np.abs(raw - truth).mean())
    assert split.mae_after == pytest.approx(0.5 * split.mae_before)
    assert split.improvement == {"identity": 0.0, "mind_meld": pytest.approx(0.5)}


def test_a_median_person_without_error_is_said():
    person = np.repeat(["a", "b", "c"], 2)
    raw = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    ladder = {
        "mind_meld": label_quality(
            person, raw, np.full(6, 0.1), np.zeros(6), np.random.default_rng(0)
        )
    }
    with pytest.raises(InvalidSummary, match=r"Too many of the 3 people.*Leave such people out"):
        SplitSummary.of(ladder)


@given(
    st.recursive(
        st.none() | st.integers() | st.text(),
        lambda x: st.lists(x) | st.dictionaries(st.sampled_from(["schema", "seed", "splits"]), x),
    )
)
def test_any_json_is_read_or_refused(value: object):
    with pytest.raises(InvalidValue):
        Summary.from_json(json.dumps(value))


@pytest.mark.parametrize("name", ["mae_before", "person_median", "per_sample_percent"])
def test_a_summary_holds_no_nan(summary: Summary, name: str):
    with pytest.raises(InvalidValue, match=f"{name} is nan"):
        replace(summary.splits["new"], **{name: math.nan})
    with pytest.raises(InvalidValue, match="spearman_new is inf"):
        StyleSummary(probe_r2=None, spearman_new=math.inf)
