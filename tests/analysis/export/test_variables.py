"""Names that SPSS and R take whatever a study calls its items, and codes that are no answers."""

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.analysis.export.asked import Place, item_variable, places
from steerlab.analysis.export.spss import fitted
from steerlab.analysis.export.variables import LONGEST_NAME, Variable, column_name, distinct
from steerlab.analysis.study_data.asked import Answered, Asking, Missing
from steerlab.study.surveys.answer_format import Number
from steerlab.study.surveys.questionnaire import Item, Questionnaire

WORDS = st.text(st.characters(codec="utf-8"), max_size=80)


@given(st.lists(WORDS, min_size=1, max_size=4))
def test_a_name_is_valid_in_spss_and_r(parts):
    name = column_name(*parts)
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
    assert len(name.encode()) <= LONGEST_NAME
    assert not name.endswith("_")
    assert name.lower() not in ("all", "by", "not", "with", "if", "true", "na")


@pytest.mark.parametrize(
    ("parts", "name"),
    [
        (("mind_meld", "raw_tlx", "mental"), "mind_meld_raw_tlx_mental"),
        (("duration", "about-you", "s"), "duration_about_you_s"),
        (("", "with"), "x_with"),
        (("7up",), "x_7up"),
    ],
)
def test_a_plain_name_stays(parts, name):
    assert column_name(*parts) == name


def test_long_names_that_begin_alike_stay_apart():
    names = [column_name("a" * 64, "b" * 64, f"i{number}") for number in range(50)]
    assert len(set(names)) == 50
    assert max(map(len, names)) == LONGEST_NAME


@given(st.lists(st.sampled_from(["a", "A", "a_2", "b" * 64, "B" * 64, "c"]), max_size=30))
def test_no_two_names_are_equal_to_spss(names):
    found = distinct(names)
    assert len({name.lower() for name in found}) == len(names)
    assert max(map(len, found), default=0) <= LONGEST_NAME
    assert found[: len(set(map(str.lower, names[:1])))] == names[:1]  # the first keeps its name


@given(st.floats(-1e6, 1e6), st.floats(0.001, 1e6))
def test_codes_of_missing_answers_are_below_every_answer(low, span):
    variable = Variable(
        name="x", label="x", kind="number", measure="scale", low=low, high=low + span, asked=True
    )
    codes = variable.missing_codes
    assert set(codes) == set(Missing)
    assert max(codes.values()) < low
    assert len(set(codes.values())) == len(Missing) == 3  # as many as SPSS takes


def test_the_codes_are_those_that_people_know():
    variable = Variable(name="x", label="x", kind="whole", measure="ordinal", low=1, asked=True)
    assert [variable.missing_codes[reason] for reason in Missing] == [-99, -98, -97]
    item = Item(id="t", text="How cold?", format=Number(minimum=-99, maximum=50, unit="°C"))
    cold = Questionnaire(
        key="cold",
        title="Cold",
        version=2,
        instructions="x",
        citation="ours",
        licence_note="ours",
        unvalidated=True,
        items=(item,),
    )
    asking = Asking(phase="pre", condition=None, questionnaire="cold")
    asked = item_variable(Place(asking=asking, questionnaire=cold, prefix=(), name="cold"), item)
    assert [asked.missing_codes[reason] for reason in Missing] == [-999, -998, -997]
    assert (asked.unit, asked.source.version, asked.low) == ("°C", 2, -99)


def test_a_questionnaire_that_is_asked_twice_has_columns_of_its_own_for_each(whole):
    again = Asking(phase="later", condition=None, questionnaire="fluency")
    found = {
        place.asking: place.prefix for place in places(replace(whole, asked=(*whole.asked, again)))
    }
    assert found[again] == ("later",)
    assert found[whole.asked[0]] == ("about-you",)
    twice = replace(whole, teach_phases=("teach", "more"))
    after = next(place for place in places(twice) if place.asking.condition)
    assert after.prefix == ("teach", after.asking.condition)


@given(st.text(max_size=300), st.integers(8, 256))
def test_a_label_fits_into_its_bytes(label, longest):
    short = fitted(label, longest)
    assert len(short.encode()) <= longest
    assert short == label or short.endswith("…")


def test_an_item_that_an_answer_hides_is_not_shown_rather_than_not_answered():
    page = Answered(state=None, given={"a": 1}, shown=("b", "a"))
    assert page.why_missing("a") is None
    assert page.why_missing("b") is Missing.NOT_ANSWERED
    assert page.why_missing("hidden") is Missing.NOT_SHOWN
    assert Answered(state=Missing.NOT_REACHED, given={}).why_missing("b") is Missing.NOT_REACHED
