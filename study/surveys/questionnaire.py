"""A questionnaire: its items, what may be answered to each, and the scales they make up."""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from typing import Any, Literal, get_args

from steerlab.sim.errors import InvalidValue, check_words
from steerlab.study.surveys.answer_format import (
    AnswerFormat,
    FreeText,
    InvalidAnswer,
    Kind,
    Likert,
    Slider,
    Value,
)
from steerlab.study.surveys.branching import ShownIf

Language = Literal["en", "de"]
"""Those in which a study's pages can speak."""
Order = Literal["fixed", "random"]

_KEY = re.compile(r"[a-z][a-z0-9_]{0,63}")
_KEY_WORDS = "lower-case letters, digits and underscores, starting with a letter"
_SAID = ("title", "text", "anchors", "low_label", "high_label", "unit")


class UnknownItem(InvalidAnswer):
    """An answer is to an item that the questionnaire does not have."""

    def __init__(self, item: str, questionnaire: str, known: tuple[str, ...]) -> None:
        super().__init__(item, None, "to an item there is")
        self.args = (f"{questionnaire} has no item {item!r}; it has {', '.join(known)}.",)


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One question or statement.

    Whether it is keyed in reverse belongs to the scale: trust items 1 to 5 are reversed in the
    trust total and not in the distrust sub-score.

    Attributes:
        id: unique within the questionnaire.
        text: as people read it.
        format: what may be answered.
        required: the page cannot be left without an answer, if the item is shown.
        shown_if: the answer it is shown after; None shows it always.
        attention: the answer of whoever reads the item, which measures nothing else.
    """

    id: str
    text: str
    format: AnswerFormat
    required: bool = True
    shown_if: ShownIf | None = None
    attention: Value | None = None

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.id):
            raise InvalidValue("id", self.id, _KEY_WORDS)
        check_words("text", self.text)
        if self.attention is None:
            return
        if isinstance(self.format, FreeText):
            allowed = "left out: who writes freely may answer rightly in many ways"
            raise InvalidValue("attention", self.attention, allowed)
        if self.format.accept(self.attention) != self.attention:
            allowed = f"an answer to the item: {self.format.allowed}"
            raise InvalidValue("attention", self.attention, allowed)

    @property
    def kind(self) -> Kind:
        """``likert``, ``choice``, ``number``, ``text`` or ``slider``."""
        return self.format.kind


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """Items that measure one thing.

    Attributes:
        key: unique within the questionnaire.
        title: for people.
        items: their ids, in order.
        reversed: ids of those that count as low + high - answer.
        how: the score is the items' ``sum`` or their ``mean``.
    """

    key: str
    title: str
    items: tuple[str, ...]
    reversed: tuple[str, ...] = ()
    how: Literal["sum", "mean"] = "sum"

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key):
            raise InvalidValue("key", self.key, _KEY_WORDS)
        check_words("title", self.title)
        if not self.items or len(set(self.items)) != len(self.items):
            raise InvalidValue("items", list(self.items), "one or more items, each once")
        if len(set(self.reversed)) != len(self.reversed) or set(self.reversed) - set(self.items):
            allowed = f"some of the scale's items ({', '.join(self.items)}), each once"
            raise InvalidValue("reversed", list(self.reversed), allowed)
        if self.how not in ("sum", "mean"):
            raise InvalidValue("how", self.how, "'sum' or 'mean'")


@dataclass(frozen=True, kw_only=True, slots=True)
class Questionnaire:
    """What is asked, as it is shown, and how it is scored.

    Attributes:
        key: unique within a study.
        title: for people.
        version: counts up whenever a word or a key of it changes.
        instructions: shown above the items.
        citation: where the items come from, or that they were written for this program.
        licence_note: what is known of the right to use them.
        unvalidated: it has not been shown to measure what its title says.
        items: in the order of the file, in which they are shown unless ``order`` is random.
        scales: may share items; a questionnaire of facts has none.
        order: random draws one for each participant (``study.item_orders``).
        language: of every word that participants read in it.
        translates: key of the questionnaire that it has in another language; empty if it is none.
    """

    key: str
    title: str
    version: int
    instructions: str
    citation: str
    licence_note: str
    unvalidated: bool
    items: tuple[Item, ...]
    scales: tuple[Scale, ...] = ()
    order: Order = "fixed"
    language: Language = "en"
    translates: str = ""

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key):
            raise InvalidValue("key", self.key, _KEY_WORDS)
        for name in ("title", "instructions", "citation", "licence_note"):
            check_words(name, getattr(self, name))
        if self.version < 1:
            raise InvalidValue("version", self.version, "a whole number from 1")
        if not self.items:
            raise InvalidValue("items", [], "one or more items")
        for name, known in (("order", get_args(Order)), ("language", get_args(Language))):
            if getattr(self, name) not in known:
                raise InvalidValue(name, getattr(self, name), f"one of {', '.join(known)}")
        ids: set[str] = set()
        for index, item in enumerate(self.items):
            if item.id in ids:
                raise InvalidValue(f"items[{index}].id", item.id, "another one: it is taken")
            ids.add(item.id)
        for index in range(len(self.items)):
            _check_branch(self.items, index)
        keys: set[str] = set()
        for index, scale in enumerate(self.scales):
            if scale.key in keys:
                key = f"scales[{index}].key"
                raise InvalidValue(key, scale.key, "another one: it is taken")
            keys.add(scale.key)
            _check_scale(scale, {item.id: item for item in self.items}, f"scales[{index}]")

    @property
    def original(self) -> str:
        """Key of what it translates, or its own: answers to both are answers to one instrument."""
        return self.translates or self.key

    @property
    def form(self) -> object:
        """All of it that is no word: equal in a questionnaire and its translations."""
        kinds = [item.kind for item in self.items]
        return kinds, self.order, _wordless([asdict(one) for one in (*self.items, *self.scales)])

    def item(self, item: str) -> Item:
        """The item of that id.

        Raises:
            UnknownItem: there is none; it is an ``InvalidAnswer``.
        """
        items = {known.id: known for known in self.items}
        if item not in items:
            raise UnknownItem(item, self.key, tuple(items))
        return items[item]

    def check(self, item: str, value: object) -> Value:
        """The answer as it is kept: a form's digits become a number, blanks around a text go.

        Raises:
            InvalidAnswer: there is no such item, or the item does not allow the answer.
        """
        asked = self.item(item)
        accepted = asked.format.accept(value)
        if accepted is None:
            raise InvalidAnswer(item, value, asked.format.allowed)
        return accepted

    def missing(self, answers: Mapping[str, Value]) -> list[str]:
        """Ids of the required items that are shown and that ``answers`` lacks, in file order."""
        return [item.id for item in self.shown(answers) if item.required and item.id not in answers]

    def shown(self, answers: Mapping[str, Value]) -> tuple[Item, ...]:
        """The items that are shown to who gave these answers, in the order of the file."""
        shown: dict[str, Item] = {}
        for item in self.items:  # what an item depends on comes before it
            rule = item.shown_if
            if rule is None or (rule.item in shown and answers.get(rule.item) in rule.answers):
                shown[item.id] = item
        return tuple(shown.values())

    def counted(self, answers: Mapping[str, Value]) -> dict[str, Value]:
        """The answers without those to items that these answers hide."""
        hidden = {item.id for item in self.items} - {item.id for item in self.shown(answers)}
        return {item: value for item, value in answers.items() if item not in hidden}

    def scale(self, scale: str) -> Scale:
        """The scale of that key.

        Raises:
            InvalidValue: there is none.
        """
        scales = {known.key: known for known in self.scales}
        if scale not in scales:
            known = ", ".join(scales) or "none: it has no scales"
            raise InvalidValue("scale", scale, f"one of {self.key}'s ({known})")
        return scales[scale]

    def item_range(self, scale: str) -> tuple[int, int]:
        """Lowest and highest answer to each item of a scale."""
        return bounds(self.item(self.scale(scale).items[0]))

    def score_range(self, scale: str) -> tuple[int, int]:
        """Lowest and highest score of a scale."""
        low, high = self.item_range(scale)
        counted = self.scale(scale)
        count = len(counted.items) if counted.how == "sum" else 1
        return count * low, count * high

    def fingerprint(self) -> str:
        """SHA-256 of everything in it, so that a study can tell whether it was changed.

        Keys that came later are left out where they have their defaults: a questionnaire without
        them keeps the hash that studies froze.
        """
        values = {**asdict(self), "kinds": [item.kind for item in self.items]}
        for table, later in (
            (values, {"order": "fixed", "language": "en", "translates": ""}),
            *((item, {"shown_if": None, "attention": None}) for item in values["items"]),
        ):
            for key, default in later.items():
                if table[key] == default:
                    del table[key]
        text = json.dumps(values, sort_keys=True, ensure_ascii=False)
        return sha256(text.encode()).hexdigest()


def bounds(item: Item) -> tuple[int, int]:
    """Lowest and highest answer to an item on a scale.

    Raises:
        InvalidValue: the item is no number that a scale can add up.
    """
    if not isinstance(item.format, (Likert, Slider)):
        raise InvalidValue("kind", item.kind, f"likert or slider: {item.id!r} is on a scale")
    return item.format.low, item.format.high


def _wordless(values: Any) -> Any:
    if isinstance(values, dict):
        return {key: _wordless(value) for key, value in values.items() if key not in _SAID}
    return [_wordless(value) for value in values] if isinstance(values, (list, tuple)) else values


def _check_branch(items: tuple[Item, ...], index: int) -> None:
    """An item depends on an earlier one, and on answers that it may have."""
    rule, key = items[index].shown_if, f"items[{index}].shown_if"
    if rule is None:
        return
    before = {item.id: item for item in items[:index]}
    if rule.item not in before:
        allowed = f"an item before it ({', '.join(before) or 'there is none'})"
        if rule.item == items[index].id:
            allowed += ", not itself"
        elif rule.item in {item.id for item in items}:
            allowed += f"; {rule.item!r} comes later, so put it before {items[index].id!r}"
        else:
            allowed += f"; there is no {rule.item!r}"
        raise InvalidValue(f"{key}.item", rule.item, allowed)
    form = before[rule.item].format
    if isinstance(form, FreeText):
        raise InvalidValue(f"{key}.item", rule.item, "an item of another kind than text")
    for place, answer in enumerate(rule.answers):
        if form.accept(answer) != answer:
            allowed = f"an answer to {rule.item!r}: {form.allowed}"
            raise InvalidValue(f"{key}.is[{place}]", answer, allowed)


def _check_scale(scale: Scale, items: Mapping[str, Item], key: str) -> None:
    ranges: set[tuple[int, int]] = set()
    for name in scale.items:
        if name not in items:
            raise InvalidValue(f"{key}.items", name, f"one of {', '.join(items)}")
        if items[name].attention is not None:
            allowed = "an item without attention: such a check measures nothing else"
            raise InvalidValue(f"{key}.items", name, allowed)
        try:
            ranges.add(bounds(items[name]))
        except InvalidValue as error:
            raise InvalidValue(f"{key}.items", name, "a likert or slider item") from error
    if len(ranges) > 1:
        allowed = "items that all have the same range"
        raise InvalidValue(f"{key}.items", sorted(ranges), allowed)
