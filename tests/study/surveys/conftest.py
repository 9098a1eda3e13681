"""A small questionnaire with an item of every kind."""

import pytest

from steerlab.study.surveys.answer_format import (
    Choice,
    FreeText,
    Likert,
    Number,
    Option,
    Slider,
)
from steerlab.study.surveys.questionnaire import Item, Questionnaire, Scale

FIVE = Likert(low=1, high=5, anchors=((1, "no"), (5, "yes")))


@pytest.fixture
def parts() -> dict:
    """Arguments of a good ``Questionnaire``."""
    return {
        "key": "small",
        "title": "Small",
        "version": 1,
        "instructions": "Answer.",
        "citation": "Ours.",
        "licence_note": "Ours.",
        "unvalidated": True,
        "items": (
            Item(id="a", text="A", format=FIVE),
            Item(id="b", text="B", format=FIVE),
            Item(id="c", text="C", format=FIVE, required=False),
            Item(id="line", text="Line", format=Slider(low_label="low", high_label="high")),
            Item(
                id="pick",
                text="Pick",
                format=Choice(options=(Option(value="x", text="X"), Option(value="y", text="Y"))),
            ),
            Item(id="age", text="Age", format=Number(minimum=16, maximum=120), required=False),
            Item(id="mass", text="Mass", format=Number(minimum=0.5, maximum=2.0, whole=False)),
            Item(id="words", text="Words", format=FreeText(longest=12)),
        ),
        "scales": (
            Scale(key="all", title="All", items=("a", "b", "c"), reversed=("b",)),
            Scale(key="two", title="Two", items=("a", "b"), how="mean"),
        ),
    }


@pytest.fixture
def small(parts) -> Questionnaire:
    """The questionnaire that ``parts`` makes."""
    return Questionnaire(**parts)
