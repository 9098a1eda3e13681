"""Questionnaires hold no contradictions and keep only answers that they allow."""

from dataclasses import FrozenInstanceError, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidValue
from steerlab.study.surveys.answer_format import (
    Choice,
    FreeText,
    InvalidAnswer,
    Likert,
    Number,
    Option,
    Slider,
)
from steerlab.study.surveys.questionnaire import Item, Questionnaire, Scale, UnknownItem

FIVE = Likert(low=1, high=5, anchors=((1, "no"), (5, "yes")))
ONES = tuple((value, "x") for value in range(1, 13))


@pytest.mark.parametrize(
    ("item", "value", "kept"),
    [
        ("a", 3, 3),
        ("a", "3", 3),
        ("a", " 5 ", 5),
        ("a", 1.0, 1),
        ("line", "0", 0),
        ("line", 95, 95),
        ("pick", "y", "y"),
        ("age", "27", 27),
        ("mass", "1.25", 1.25),
        ("words", "  two\r\nlines ", "two\nlines"),
        ("words", "ÄÖ 語", "ÄÖ 語"),
    ],
)
def test_an_allowed_answer_is_normalised(small, item, value, kept):
    found = small.check(item, value)
    assert found == kept
    assert type(found) is type(kept)


@pytest.mark.parametrize(
    ("item", "value"),
    [
        *(("a", value) for value in (0, 6, 2.5, True, None, "", "x", "1_0", "nan", float("inf"))),
        *(("a", value) for value in (10**400, "9" * 5000, "٣", [3], b"3")),
        *(("line", value) for value in (-5, 105, 52, "7.5", "low")),
        *(("pick", value) for value in ("X", "z", "", " x", 1, None)),
        *(("age", value) for value in (15, 121, 20.5, "twenty", "20,5")),
        *(("mass", value) for value in (0.49, 2.01, "nan", "1,25", True)),
        *(("words", value) for value in ("", "   ", "x" * 13, "a\0b", "\ud800", 3, "\x1b[2J")),
    ],
)
def test_any_other_answer_is_refused_in_one_sentence(small, item, value):
    with pytest.raises(
        InvalidAnswer, match=f"^The answer to '{item}' is .*; it must be "
    ) as caught:
        small.check(item, value)
    assert caught.value.item == item
    assert len(str(caught.value)) < 250


@given(st.one_of(st.integers(), st.floats(), st.text(), st.booleans(), st.none()))
def test_what_was_kept_would_be_kept_again(value):
    for form in (
        FIVE,
        Slider(low_label="l", high_label="h"),
        Number(minimum=-3, maximum=40.5, whole=False),
        FreeText(longest=20),
    ):
        kept = form.accept(value)
        if kept is not None:
            assert form.accept(kept) == kept
            assert form.accept(str(kept)) == kept


def test_an_answer_to_no_item_is_refused(small):
    with pytest.raises(UnknownItem, match=r"small has no item 'd'; it has a, b, c, "):
        small.check("d", 3)


def test_missing_names_the_required_items_in_order(small):
    assert small.missing({"b": 2, "line": 5}) == ["a", "pick", "mass", "words"]
    full = {"a": 1, "b": 1, "line": 0, "pick": "x", "mass": 1.0, "words": "w"}
    assert small.missing(full) == []


def test_ranges_follow_how_a_scale_is_scored(small):
    assert small.score_range("all") == (3, 15)
    assert small.score_range("two") == (1, 5)
    assert small.item_range("two") == (1, 5)
    with pytest.raises(InvalidValue, match=r"scale is 'three'.*\(all, two\)"):
        small.score_range("three")


def test_points_and_kinds(small):
    assert small.item("a").format.points == ((1, "no"), (2, ""), (3, ""), (4, ""), (5, "yes"))
    kinds = [item.kind for item in small.items]
    assert kinds == ["likert"] * 3 + ["slider", "choice", "number", "number", "text"]


def test_it_is_frozen_and_its_fingerprint_follows_every_word(small):
    with pytest.raises(FrozenInstanceError):
        small.title = "Other"
    prints = {
        small.fingerprint(),
        replace(small, title="Other").fingerprint(),
        replace(small, version=2).fingerprint(),
        replace(small, items=(replace(small.items[0], text="A!"), *small.items[1:])).fingerprint(),
        replace(small, scales=(small.scales[0],)).fingerprint(),
    }
    assert len(prints) == 5
    assert replace(small).fingerprint() == small.fingerprint()


def _with_scale(scale: Scale):
    return lambda parts: parts | {"scales": (*parts["scales"], scale)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p | {"key": "Small One"}, "^key is 'Small One'; it must be lower-case"),
        (lambda p: p | {"title": " "}, "^title is ' '; it must be some words"),
        (lambda p: p | {"citation": ""}, "^citation is ''"),
        (lambda p: p | {"version": 0}, "^version is 0; it must be a whole number from 1"),
        (lambda p: p | {"items": (), "scales": ()}, "^items is "),
        (lambda p: p | {"items": (*p["items"], p["items"][1])}, r"^items\[8\]\.id is 'b'; .*taken"),
        (lambda p: p | {"scales": p["scales"] * 2}, r"^scales\[2\]\.key is 'all'; .*taken"),
        (
            _with_scale(Scale(key="s", title="S", items=("a", "z"))),
            r"^scales\[2\]\.items is 'z'; it must be one of a, b, c",
        ),
        (
            _with_scale(Scale(key="s", title="S", items=("a", "pick"))),
            r"^scales\[2\]\.items is 'pick'; it must be a likert or slider item",
        ),
        (
            _with_scale(Scale(key="s", title="S", items=("a", "line"))),
            r"^scales\[2\]\.items is .*same range",
        ),
    ],
)
def test_a_questionnaire_that_contradicts_itself_is_refused(parts, change, message):
    with pytest.raises(InvalidValue, match=message):
        Questionnaire(**change(parts))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Item(id="1a", text="A", format=FIVE), "^id is '1a'"),
        (lambda: Item(id="a", text="", format=FIVE), "^text is ''"),
        (lambda: Scale(key="s", title="S", items=()), "^items is "),
        (lambda: Scale(key="s", title="S", items=("a", "a")), "^items is .*each once"),
        (
            lambda: Scale(key="s", title="S", items=("a",), reversed=("b",)),
            r"^reversed is \['b'\]; it must be some of the scale's items \(a\)",
        ),
        (lambda: Scale(key="s", title="S", items=("a",), reversed=("a", "a")), "^reversed is "),
        (lambda: Scale(key="s", title="S", items=("a",), how="median"), "^how is 'median'"),
        (lambda: Likert(low=5, high=1, anchors=((1, "x"), (5, "y"))), "^high is 1"),
        (lambda: Likert(low=1, high=12, anchors=ONES), "^high is 12; .*11 points"),
        (lambda: Likert(low=1, high=5, anchors=((1, "x"),)), "^anchors is .*both ends"),
        (lambda: Likert(low=1, high=5, anchors=((1, "x"), (5, "y"), (6, "z"))), "^anchors is 6"),
        (lambda: Likert(low=1, high=5, anchors=((1, "x"), (5, "y"), (5, "z"))), "^anchors is "),
        (lambda: Likert(low=1, high=5, anchors=((1, " "), (5, "y"))), r"^anchors\.1 is ' '"),
        (lambda: Slider(step=30, low_label="l", high_label="h"), "^step is 30"),
        (lambda: Slider(step=0, low_label="l", high_label="h"), "^step is 0"),
        (lambda: Slider(low_label="l", high_label=""), "^high_label is ''"),
        (lambda: Choice(options=(Option(value="x", text="X"),)), "^options is "),
        (lambda: Choice(options=(Option(value="x", text="X"),) * 2), "^options is "),
        (
            lambda: Choice(options=(Option(value="x", text="X"), Option(value="y ", text="Y"))),
            r"^options\[1\]\.value is 'y '",
        ),
        (lambda: Number(minimum=2, maximum=2), "^maximum is 2"),
        (lambda: Number(minimum=0.2, maximum=0.8), "^maximum is 0.8; .*a whole number is within"),
        (lambda: Number(minimum=float("nan"), maximum=2), "^minimum is nan"),
        (lambda: FreeText(longest=0), "^longest is 0"),
    ],
)
def test_a_part_that_cannot_be_is_refused(make, message):
    with pytest.raises(InvalidValue, match=message):
        make()
