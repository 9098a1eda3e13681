"""Questionnaires as TOML; what is wrong in a file is named with its line, key and value."""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from steerlab.sim.errors import InvalidConfig
from steerlab.study.surveys.answer_format import (
    AnswerFormat,
    Choice,
    FreeText,
    Likert,
    Number,
    Option,
    Slider,
)
from steerlab.study.surveys.errors import QuestionnaireError
from steerlab.study.surveys.questionnaire import Item, Questionnaire, Scale
from steerlab.study.surveys.toml_lines import line_of

FORMAT = 1

_Types = dict[str, tuple[type, ...]]
_TOP: _Types = {
    "format": (int,),
    **dict.fromkeys(("key", "title", "instructions", "citation", "licence_note"), (str,)),
    "version": (int,),
    "unvalidated": (bool,),
    "defaults": (dict,),
    "items": (list,),
    "scales": (list,),
}
_ITEM: _Types = {"id": (str,), "text": (str,), "kind": (str,), "required": (bool,)}
_KINDS: dict[str, _Types] = {
    "likert": {"low": (int,), "high": (int,), "anchors": (dict,)},
    "slider": {
        **dict.fromkeys(("low", "high", "step"), (int,)),
        **dict.fromkeys(("low_label", "high_label"), (str,)),
    },
    "choice": {"options": (list,)},
    "number": {
        **dict.fromkeys(("minimum", "maximum"), (int, float)),
        "unit": (str,),
        "whole": (bool,),
    },
    "text": {"longest": (int,)},
}
_NEEDED = {
    "likert": ("low", "high", "anchors"),
    "slider": ("low_label", "high_label"),
    "choice": ("options",),
    "number": ("minimum", "maximum"),
    "text": (),
}
_DEFAULTS = {
    name: types
    for kind in ({"kind": (str,), "required": (bool,)}, *_KINDS.values())
    for name, types in kind.items()
}
_SCALE: _Types = {
    **dict.fromkeys(("key", "title", "how"), (str,)),
    **dict.fromkeys(("items", "reversed"), (list,)),
}
_OPTION: _Types = {"value": (str,), "text": (str,)}
_WORDS = {
    int: "a whole number",
    float: "a number",
    str: "a text",
    bool: "true or false",
    list: "a list",
    dict: "a table",
}


def questionnaire_from_toml(text: str, file: str) -> Questionnaire:
    """Read one questionnaire; ``file`` is named in errors.

    Raises:
        QuestionnaireError: with line, key, value and what is allowed.
        InvalidConfig: the text is no TOML at all.
    """
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number too long is a plain ValueError
        raise InvalidConfig(f"{file} is no TOML: {error}. Mend it there.") from error
    try:
        return _questionnaire(content)
    except QuestionnaireError as error:
        raise error.at(file, line_of(text, error.key)) from None


def _questionnaire(content: dict[str, Any]) -> Questionnaire:
    _check("", content, _TOP, [key for key in _TOP if key not in ("defaults", "scales")])
    if content["format"] != FORMAT:
        raise QuestionnaireError("format", content["format"], f"{FORMAT}, the only one there is")
    defaults = content.get("defaults", {})
    _check("defaults", defaults, _DEFAULTS, ())
    return Questionnaire(
        key=content["key"],
        title=content["title"],
        version=content["version"],
        instructions=content["instructions"].strip(),
        citation=content["citation"].strip(),
        licence_note=content["licence_note"].strip(),
        unvalidated=content["unvalidated"],
        items=tuple(
            _item(f"items[{place}]", item, defaults)
            for place, item in enumerate(content["items"], 1)
        ),
        scales=tuple(
            _scale(f"scales[{place}]", scale)
            for place, scale in enumerate(content.get("scales", []), 1)
        ),
    )


def _item(place: str, given: object, defaults: Mapping[str, Any]) -> Item:
    table = _table(place, given)
    kind = table.get("kind", defaults.get("kind"))
    if kind not in _KINDS:
        where = place if "kind" in table or "kind" not in defaults else "defaults"
        raise QuestionnaireError(f"{where}.kind", kind, f"one of {', '.join(_KINDS)}")
    types = _ITEM | _KINDS[kind]
    inherited = {key: value for key, value in defaults.items() if key in types}
    content = inherited | table
    try:
        _check(place, content, types, ("id", "text", *_NEEDED[kind]))
        parts = {key: value for key, value in content.items() if key in _KINDS[kind]}
        try:
            return Item(
                id=content["id"],
                text=content["text"],
                format=_format(place, kind, parts),
                required=content.get("required", True),
            )
        except QuestionnaireError as error:
            raise error if error.key.startswith(place) else error.under(place) from None
    except QuestionnaireError as error:
        name = error.key.removeprefix(f"{place}.").partition(".")[0].partition("[")[0]
        if name in inherited and name not in table:
            key = error.key.replace(place, "defaults", 1)
            raise QuestionnaireError(key, error.value, error.allowed) from None
        raise


def _format(place: str, kind: str, parts: dict[str, Any]) -> AnswerFormat:
    match kind:
        case "likert":
            anchors = _anchors(f"{place}.anchors", parts["anchors"])
            return Likert(low=parts["low"], high=parts["high"], anchors=anchors)
        case "slider":
            return Slider(**parts)
        case "choice":
            options: list[Option] = []
            for number, option in enumerate(parts["options"], 1):
                where = f"{place}.options[{number}]"
                table = _table(where, option)
                _check(where, table, _OPTION, tuple(_OPTION))
                options.append(Option(**table))
            return Choice(options=tuple(options))
        case "number":
            return Number(**parts)
        case _:
            return FreeText(**parts)


def _anchors(place: str, given: Mapping[str, object]) -> tuple[tuple[int, str], ...]:
    found: list[tuple[int, str]] = []
    for key, words in given.items():
        if not re.fullmatch(r"-?\d{1,3}", key):
            raise QuestionnaireError(place, key, "a table of words by whole number")
        if not isinstance(words, str):
            raise QuestionnaireError(f"{place}.{key}", words, _WORDS[str])
        found.append((int(key), words))
    return tuple(sorted(found))


def _scale(place: str, given: object) -> Scale:
    table = _table(place, given)
    _check(place, table, _SCALE, ("key", "title", "items"))
    for name in ("items", "reversed"):
        for one in table.get(name, []):
            if not isinstance(one, str):
                raise QuestionnaireError(f"{place}.{name}", one, "the id of an item")
    try:
        return Scale(
            key=table["key"],
            title=table["title"],
            items=tuple(table["items"]),
            reversed=tuple(table.get("reversed", [])),
            how=table.get("how", "sum"),
        )
    except QuestionnaireError as error:
        raise error.under(place) from None


def _table(place: str, given: object) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise QuestionnaireError(place, given, _WORDS[dict])
    return given


def _check(
    place: str, content: Mapping[str, Any], types: _Types, needed: tuple[str, ...] | list[str]
) -> None:
    dot = f"{place}." if place else ""
    for key, value in content.items():
        kinds = types.get(key)
        if kinds is None:
            raise QuestionnaireError(f"{dot}{key}", value, f"one of the keys {', '.join(types)}")
        if type(value) not in kinds:  # a bool is an int to isinstance
            raise QuestionnaireError(f"{dot}{key}", value, _WORDS[kinds[-1]])
    for key in needed:
        if key not in content:
            raise QuestionnaireError(f"{dot}{key}", None, f"given: {_WORDS[types[key][-1]]}")
