"""Questionnaires as TOML: the shipped ones, and those that a study's folder brings."""

import re
from collections.abc import Mapping
from dataclasses import MISSING, field, fields, make_dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, get_type_hints

from steerlab.sim.errors import InvalidConfig, InvalidValue
from steerlab.sim.files.by_suffix import files_with
from steerlab.sim.files.structured import (
    as_table,
    one_of,
    structured,
    toml_values,
    utf8_text,
    versioned,
    within,
    within_file,
)
from steerlab.study.surveys.answer_format import Choice, FreeText, Likert, Number, Slider, Value
from steerlab.study.surveys.branching import ShownIf
from steerlab.study.surveys.questionnaire import Item, Questionnaire

FORMAT = 1
_OF_EVERY_ITEM = ("id", "text", "required", "shown_if", "attention")
_FORMATS = {form.kind: form for form in (Likert, Slider, Choice, Number, FreeText)}


def shipped_questionnaires() -> dict[str, Questionnaire]:
    """Those that come with the program, by key."""
    return dict(_shipped())


def all_questionnaires(folder: Path | None = None) -> dict[str, Questionnaire]:
    """The shipped ones and those of a study's folder, by key.

    Args:
        folder: holds one ``<key>.toml`` for each of the study's own; None for the shipped alone.

    Raises:
        InvalidConfig: a file is wrong, translates what it does not have the form of, or brings a key
            that a shipped questionnaire has: a study never changes a known instrument under its name.
    """
    questionnaires = shipped_questionnaires()
    ours: set[str] = set()
    for path in _files(folder):
        if path.stem in ours:  # mine.toml and mine.TOML, where they are two files
            raise InvalidConfig(f"{folder} has two files of the key {path.stem}; remove one.")
        ours.add(path.stem)
        if path.stem in questionnaires:
            raise InvalidConfig(
                f"{path} has the key of a shipped questionnaire, which it would replace; give "
                f"file and key another name, such as {path.stem}_ours."
            )
        questionnaires[path.stem] = questionnaire_from_toml(utf8_text(path), str(path))
    for key in sorted(ours):
        _check_translation(questionnaires[key], questionnaires)
    return questionnaires


def load_questionnaire(key: str, folder: Path | None = None) -> Questionnaire:
    """The questionnaire of that key.

    Args:
        folder: as in ``all_questionnaires``.

    Raises:
        InvalidConfig: there is none, or as in ``all_questionnaires``.
    """
    known = all_questionnaires(folder)
    if key not in known:
        where = f" or put {key}.toml into {folder}" if folder else ""
        raise InvalidConfig(
            f"There is no questionnaire {key!r}; choose one of {', '.join(sorted(known))}{where}."
        )
    return known[key]


def questionnaire_from_toml(text: str, file: str) -> Questionnaire:
    """Read one questionnaire; ``file`` is named in errors, and its key must be the file's name.

    Raises:
        InvalidConfig: with line, key, value and what is allowed.
    """
    name = re.sub(r"\.toml$", "", re.split(r"[/\\]", file)[-1], flags=re.IGNORECASE)
    content = toml_values(text, file)
    with within_file(file, text):
        values = versioned(Questionnaire, content, "format", FORMAT, ("defaults",))
        questionnaire = structured(Questionnaire, _with_items(values))
        if questionnaire.key != name:  # so that no folder holds a key twice
            raise InvalidValue("key", questionnaire.key, f"{name!r}, as the file is named")
    return questionnaire


def _check_translation(one: Questionnaire, known: Mapping[str, Questionnaire]) -> None:
    if not one.translates:
        return
    original = known.get(one.translates)
    if original is None or original.translates or original.language == one.language:
        raise InvalidConfig(
            f"{one.key} translates {one.translates!r}; name a questionnaire in another language "
            f"than {one.language!r} that is no translation itself."
        )
    if original.form != one.form:
        raise InvalidConfig(
            f"{one.key} translates {one.translates!r}, and differs from it in more than words; give "
            f"it the same items, answers and scales, or leave translates out."
        )


def _with_items(values: dict[str, Any]) -> dict[str, Any]:
    """The file's values, with items as records that have the defaults filled in."""
    defaults = values.get("defaults", {})
    with within("defaults"):
        structured(_defaults_record(), defaults)
    given = {key: value for key, value in values.items() if key != "defaults"}
    for key in ("instructions", "citation", "licence_note"):
        if isinstance(given.get(key), str):  # a multi-line text ends with a line break
            given[key] = given[key].strip()
    if isinstance(items := given.get("items"), list):
        given["items"] = [
            _item(f"items[{index}]", item, defaults) for index, item in enumerate(items)
        ]
    return given


def _item(path: str, given: object, defaults: Mapping[str, Any]) -> Item:
    """An item; in the file the keys of its answer format stand beside its ``id`` and ``text``."""
    with within(path):
        table = as_table(given)
    kind = table.get("kind", defaults.get("kind"))
    if not isinstance(kind, str) or kind not in _FORMATS:
        where = path if "kind" in table or "kind" not in defaults else "defaults"
        raise InvalidValue(f"{where}.kind", kind, f"one of {one_of(_FORMATS, kind)}")
    record = _item_record(kind)
    keys = {known.name for known in fields(record)}
    inherited = {key: value for key, value in defaults.items() if key in keys and key not in table}
    try:
        read = structured(record, inherited | table)
        shared = {key: getattr(read, key) for key in _OF_EVERY_ITEM}
        values = {key: getattr(read, key) for key in keys - {"kind", *_OF_EVERY_ITEM}}
        if "anchors" in values:
            values["anchors"] = tuple(sorted(values["anchors"].items()))
        answer = _FORMATS[kind](**values)
        return Item(format=answer, **shared)
    except InvalidValue as error:
        named = re.split(r"[.\[]", error.path)[0]
        raise error.under("defaults" if named in inherited else path) from None


@cache
def _item_record(kind: str) -> Any:
    """A dataclass of the keys that an item of this kind has in the file."""
    common = [
        ("id", str),
        ("text", str),
        ("kind", str, kind),
        ("required", bool, True),
        ("shown_if", ShownIf | None, None),
        ("attention", Value | None, None),
    ]
    return make_dataclass(f"{kind}_item", [*common, *_format_fields(kind)], kw_only=True)


@cache
def _defaults_record() -> Any:
    """A dataclass of the keys that ``[defaults]`` may have: those of every kind of item."""
    shared = {name: hint for kind in _FORMATS for name, hint, _ in _format_fields(kind)}
    names = {"kind": str, "required": bool} | shared
    return make_dataclass("defaults", [(name, hint, None) for name, hint in names.items()])


def _format_fields(kind: str) -> list[tuple[str, Any, Any]]:
    hints = get_type_hints(_FORMATS[kind]) | {"anchors": Mapping[int, str]}
    return [
        (known.name, hints[known.name], field() if known.default is MISSING else known.default)
        for known in fields(_FORMATS[kind])
    ]


@cache
def _shipped() -> tuple[tuple[str, Questionnaire], ...]:
    folder = resources.files("steerlab.assets") / "questionnaires"
    texts = {
        file.name: file.read_text(encoding="utf-8")
        for file in folder.iterdir()
        if file.name.endswith(".toml")
    }
    shipped = [questionnaire_from_toml(texts[name], name) for name in sorted(texts)]
    return tuple((questionnaire.key, questionnaire) for questionnaire in shipped)


def _files(folder: Path | None) -> list[Path]:
    if folder is None:
        return []
    if not folder.is_dir():
        raise InvalidConfig(f"{folder} is no folder; make it, or ask for shipped questionnaires.")
    return files_with(folder, ".toml")
