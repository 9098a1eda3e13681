"""A questionnaire as a form: fields to show, and answers read from what was posted."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from steerlab.app.console import texts
from steerlab.study.surveys.answer_format import (
    AnswerFormat,
    Choice,
    FreeText,
    InvalidAnswer,
    Likert,
    Number,
    Slider,
    Value,
)
from steerlab.study.surveys.questionnaire import Item, Questionnaire

ITEM_PREFIX = "item."  # no item can pass for another field of the form


@dataclass(frozen=True, kw_only=True, slots=True)
class Point:
    """One radio button: what is posted, what stands on it, and its words, if it has any."""

    value: str
    label: str
    words: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Field:
    """One question as the page shows it.

    Attributes:
        name: of its inputs.
        number: from 1, as people count, of those that are shown; 0 of one that is not.
        look: ``row`` of numbered points, ``words`` where every point has some, ``list`` of
            options, ``number`` or ``text``.
        points: radio buttons, if it has any.
        ends: words at both ends of a row.
        value: as posted or kept; empty if there is none.
        mark: what is wrong with it; empty if nothing is.
        hint: what may be entered.
        shown: as far as the answers so far say.
        depends_on: the item on whose answer that depends; empty if it is always shown.
        shown_after: those answers, as a list in JSON.
        follows: the last page did not show it, and answers given there lead to it.
    """

    name: str
    item: str
    number: int
    text: str
    required: bool
    look: Literal["row", "words", "list", "number", "text"]
    points: tuple[Point, ...] = ()
    ends: tuple[str, str] = ("", "")
    value: str = ""
    mark: str = ""
    hint: str = ""
    unit: str = ""
    longest: int = 0
    shown: bool = True
    depends_on: str = ""
    shown_after: str = ""
    follows: bool = False

    @property
    def needs_look(self) -> bool:
        """Whether it is to be looked at again, or for the first time."""
        return bool(self.mark) or self.follows


@dataclass(frozen=True, kw_only=True, slots=True)
class PostedAnswers:
    """What a form changes.

    Attributes:
        answers: by item; None where an answer was taken back.
        wrong: what is wrong with those that cannot be kept, by item.
        typed: what those were.
    """

    answers: Mapping[str, Value | None]
    wrong: Mapping[str, str]
    typed: Mapping[str, str]


def form_fields(
    questionnaire: Questionnaire,
    answers: Mapping[str, Value],
    *,
    order: Sequence[str],
    marks: Mapping[str, str] | None = None,
    typed: Mapping[str, str] | None = None,
    follow: Collection[str] = (),
) -> list[Field]:
    """All questions with the answers so far, hidden ones too, which a script may show.

    Args:
        order: ids of all items, as the page has them.
        marks: what is wrong, by item.
        typed: what stands in a field though it cannot be kept, by item.
        follow: items that the last page did not show.
    """
    fields: list[Field] = []
    shown = {item.id for item in questionnaire.shown(answers)}
    number = 0
    for item in map(questionnaire.item, order):
        look, points, ends = _look(item.format)
        number += item.id in shown
        rule = item.shown_if
        kept = answers.get(item.id)
        fields.append(
            Field(
                name=ITEM_PREFIX + item.id,
                item=item.id,
                number=number if item.id in shown else 0,
                text=item.text,
                required=item.required,
                look=look,
                points=points,
                ends=ends,
                value=(typed or {}).get(item.id, "" if kept is None else str(kept)),
                mark=(marks or {}).get(item.id, ""),
                hint=_hint(item.format),
                unit=item.format.unit if isinstance(item.format, Number) else "",
                longest=item.format.longest if isinstance(item.format, FreeText) else 0,
                shown=item.id in shown,
                depends_on="" if rule is None else rule.item,
                shown_after="" if rule is None else json.dumps(rule.answers),
                follows=item.id in follow,
            )
        )
    return fields


def read_posted(
    questionnaire: Questionnaire, posted: Mapping[str, str], kept: Mapping[str, Value]
) -> PostedAnswers:
    """What a whole form changes about the answers that are kept.

    Fields of items that the answers hide are left alone, whatever stands in them.
    """
    answers: dict[str, Value | None] = {}
    wrong: dict[str, str] = {}
    typed: dict[str, str] = {}
    for item in questionnaire.items:
        raw = posted.get(ITEM_PREFIX + item.id)
        if raw is None:  # a row without a choice posts nothing
            continue
        try:
            value = read_answer(questionnaire, item.id, raw)
        except InvalidAnswer:
            wrong[item.id] = what_is_wrong(item)
            typed[item.id] = raw
            continue
        if value != kept.get(item.id):
            answers[item.id] = value
    after = {item: value for item, value in {**kept, **answers}.items() if value is not None}
    shown = {item.id for item in questionnaire.shown(after)}
    return PostedAnswers(
        answers={item: value for item, value in answers.items() if item in shown},
        wrong={item: words for item, words in wrong.items() if item in shown},
        typed={item: words for item, words in typed.items() if item in shown},
    )


def read_answer(questionnaire: Questionnaire, item: str, raw: str) -> Value | None:
    """One posted answer as it is kept; None if the field was emptied.

    Raises:
        InvalidAnswer: there is no such item, or it does not allow this.
    """
    asked = questionnaire.item(item)
    if not raw.strip() and asked.kind in ("number", "text"):
        return None
    return questionnaire.check(item, raw)


def what_is_wrong(item: Item) -> str:
    """Why an answer cannot be kept, for who gave it."""
    kind = item.format
    if isinstance(kind, Number):
        words = texts.WRONG_WHOLE if kind.whole else texts.WRONG_NUMBER
        return words.format(low=f"{kind.minimum:g}", high=f"{kind.maximum:g}")
    if isinstance(kind, FreeText):
        return texts.WRONG_TEXT.format(longest=kind.longest)
    return texts.WRONG_CHOICE


def _look(
    kind: AnswerFormat,
) -> tuple[Literal["row", "words", "list", "number", "text"], tuple[Point, ...], tuple[str, str]]:
    if isinstance(kind, Likert):
        points = tuple(
            Point(value=str(value), label=str(value), words=words) for value, words in kind.points
        )
        if all(point.words for point in points):
            return "words", points, ("", "")
        return "row", points, (points[0].words, points[-1].words)
    if isinstance(kind, Slider):
        ends = {kind.low: kind.low_label, kind.high: kind.high_label}
        points = tuple(
            Point(value=str(value), label=str(value), words=ends.get(value, ""))
            for value in range(kind.low, kind.high + 1, kind.step)
        )
        # So many points wrap on a narrow screen, where the ends of the row are not the scale's.
        words = (f"{kind.low}: {kind.low_label}", f"{kind.high}: {kind.high_label}")
        return "row", points, words
    if isinstance(kind, Choice):
        options = tuple(Point(value=option.value, label=option.text) for option in kind.options)
        return "list", options, ("", "")
    return ("number" if isinstance(kind, Number) else "text"), (), ("", "")


def _hint(kind: AnswerFormat) -> str:
    if isinstance(kind, Number):
        return texts.RANGE.format(low=f"{kind.minimum:g}", high=f"{kind.maximum:g}")
    if isinstance(kind, FreeText):
        return texts.LONGEST.format(longest=kind.longest)
    return ""
