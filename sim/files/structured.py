"""From plain values, as TOML and JSON hold them, to frozen dataclasses, which the files' keys are.

cattrs does the work, more strictly than by itself: nothing is converted (but a whole number where
any number will do), no key is unknown, and whatever is wrong is an ``InvalidValue`` with its path.
"""

import difflib
import json
import re
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import EnumType
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from steerlab.sim.errors import InvalidConfig, InvalidValue, SteerlabError, shown
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.toml_lines import line_of

if TYPE_CHECKING:  # twenty milliseconds, which only whoever reads a file should pay
    from cattrs import Converter

BYTE_ORDER_MARK = "\ufeff"  # Windows' editors begin UTF-8 files with one; it means nothing
Kind = TypeVar("Kind")
Hook = Callable[[Any, Any], Any]

_WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a finite number",
    str: "a text",
}
_WHOLE = re.compile(r"-?[0-9]{1,9}")


def structured(kind: type[Kind], values: object) -> Kind:
    """A record of ``kind``, or a list or mapping of such, from plain values.

    A field is under its own name, or under the ``key`` in its metadata. What is a record already
    is taken as it is. Keys of a ``Mapping[int, ...]`` are written as texts.

    Raises:
        InvalidValue: a key is unknown or missing, a value is not of its type, or a record refuses
            it; ``path`` begins at ``values``.
    """
    return _converter().structure(values, kind)


def versioned(
    kind: type, values: object, key: str, version: int, more: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The table of a file that holds a ``kind``, without its ``key``, which must be ``version``.

    Args:
        more: what it may have beside the fields of ``kind``.

    Raises:
        InvalidValue: it is another version, or a key is unknown.
    """
    table = as_table(values)
    allowed = f"{version}, the only one that this steerlab reads"
    if key not in table:
        raise InvalidValue.missing(key, allowed)
    if type(table[key]) is not int or table[key] != version:
        raise InvalidValue(key, table[key], allowed)
    _check_keys(table, (key, *_keys(kind).values(), *more))
    return {name: value for name, value in table.items() if name != key}


def as_table(values: object) -> dict[str, Any]:
    """``values`` themselves.

    Raises:
        InvalidValue: they are no table.
    """
    if not isinstance(values, dict):
        raise InvalidValue("", values, "a table of keys and values")
    return values


@contextmanager
def within(place: str) -> Iterator[None]:
    """What is wrong with the values at ``place``, such as ``phases[0]``, is named with it.

    Raises:
        InvalidValue: as the body, or in place of a record's other refusals.
    """
    try:
        yield
    except SteerlabError as error:
        raise InvalidValue.refused(None, error).under(place) from None


@contextmanager
def within_file(file: str, text: str = "") -> Iterator[None]:
    """What is wrong with the values of a file is named with it, and with their line.

    Args:
        file: as people know it; may be empty.
        text: the whole of a TOML file; empty if lines say nothing.
    """
    try:
        yield
    except InvalidValue as error:
        whole = error.under("$")
        raise whole.at(file, line_of(text.removeprefix(BYTE_ORDER_MARK), whole.path)) from None


def toml_values(text: str, file: str) -> dict[str, Any]:
    """The values of a TOML text; ``file`` is named in errors.

    Raises:
        InvalidConfig: it is none.
    """
    try:
        return tomllib.loads(text.removeprefix(BYTE_ORDER_MARK))
    except (ValueError, RecursionError) as error:  # a number too long is a plain ValueError
        raise InvalidConfig(f"{file} is no TOML: {error}. Mend it there.") from error


def json_values(text: str, file: str) -> Any:
    """The values of a JSON text; ``file`` is named in errors.

    Raises:
        InvalidConfig: it is none, or an object has a key twice.
    """
    try:
        text = text.removeprefix(BYTE_ORDER_MARK)
        return json.loads(text, object_pairs_hook=_each_key_once)
    except (ValueError, RecursionError) as error:
        raise InvalidConfig(f"{file} is no JSON: {error}.") from error


def utf8_text(path: Path) -> str:
    """The text of a file, to the last byte: whoever hashes it needs it as it is.

    So line ends, and a byte-order mark that it may begin with, are kept.

    Raises:
        InvalidConfig: it cannot be read, or is no UTF-8.
    """
    try:
        return path.read_bytes().decode()
    except OSError as error:
        raise InvalidConfig(f"{path} cannot be read: {refusal(error)}.") from error
    except UnicodeDecodeError as error:
        raise InvalidConfig(f"{path} is not UTF-8: {error}. Save it as UTF-8.") from error


def one_of(known: Iterable[object], given: object) -> str:
    """``known`` in words, with what was probably meant by ``given``."""
    names = [str(one) for one in known]
    near = difflib.get_close_matches(str(given), names, n=1)
    return ", ".join(names) + (f" (did you mean {near[0]!r}?)" if near else "")


@cache
def _converter() -> "Converter":
    from cattrs import Converter

    converter = Converter()
    for kind in (str, int, float):  # and what derives from them: bool, and enums of texts
        converter.register_structure_hook(kind, _plain)
    for fits, make in (
        (lambda kind: get_origin(kind) is Literal, _literal),
        (_is_any_scalar, _any_scalar),
        (lambda kind: get_origin(kind) is tuple, _list),
        (lambda kind: get_origin(kind) in (dict, Mapping), _mapping),
        (is_dataclass, _record),
    ):
        converter.register_structure_hook_factory(fits, make)
    return converter


def _plain(value: Any, kind: Any) -> Any:
    if isinstance(kind, EnumType):
        members: Any = kind
        return members(_chosen(value, [one.value for one in members]))
    if kind is float:
        if type(value) in (int, float) and abs(value) <= sys.float_info.max:
            return float(value)
    elif type(value) is kind:  # a bool is an int to isinstance
        return value
    raise InvalidValue("", value, _words(kind))


def _literal(kind: Any, converter: "Converter") -> Hook:
    return lambda value, _: _chosen(value, get_args(kind))


def _chosen(value: Any, known: Sequence[Any]) -> Any:
    if any(type(value) is type(one) and value == one for one in known):
        return value
    raise InvalidValue("", value, f"one of {one_of(known, value)}")


def _is_any_scalar(kind: Any) -> bool:
    """Several kinds of plain values may be there, such as ``str | int | float``."""
    kinds = set(get_args(kind)) - {NoneType}
    return get_origin(kind) in (Union, UnionType) and len(kinds) > 1 and kinds <= {str, int, float}


def _any_scalar(kind: Any, converter: "Converter") -> Hook:
    def structure(value: Any, _: Any) -> Any:
        if type(value) not in get_args(kind):
            raise InvalidValue("", value, _words(kind))
        return value

    return structure


def _list(kind: Any, converter: "Converter") -> Hook:
    """Of any length if it is ``tuple[item, ...]``."""
    items = get_args(kind)
    any_length = items[-1] is ...
    hooks = [converter.get_structure_hook(item) for item in items if item is not ...]

    def structure(value: Any, _: Any) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple) or not (any_length or len(value) == len(items)):
            raise InvalidValue("", value, _words(kind))
        found: list[Any] = []
        try:
            for place, one in enumerate(value):
                item = 0 if any_length else place
                found.append(hooks[item](one, items[item]))
        except InvalidValue as error:
            raise error.under(f"[{len(found)}]") from None
        return tuple(found)

    return structure


def _mapping(kind: Any, converter: "Converter") -> Hook:
    key_kind, item_kind = get_args(kind)

    def structure(value: Any, _: Any) -> dict[Any, Any]:
        found: dict[Any, Any] = {}
        for key, one in as_table(value).items():
            try:
                name = int(key) if key_kind is int and _WHOLE.fullmatch(key) else key
                name = converter.structure(name, key_kind)
            except InvalidValue as error:
                allowed = f"under a key that is {error.allowed}"
                raise InvalidValue(_step(key), one, allowed) from None
            try:
                found[name] = converter.structure(one, item_kind)
            except InvalidValue as error:
                raise error.under(_step(key)) from None
        return found

    return structure


def _record(kind: Any, converter: "Converter") -> Hook:
    from cattrs import ClassValidationError
    from cattrs.gen import make_dict_structure_fn, override

    hints = get_type_hints(kind)
    keys = _keys(kind)
    renamed: Any = {name: override(rename=key) for name, key in keys.items() if key != name}
    build = make_dict_structure_fn(
        kind,
        converter,
        _cattrs_forbid_extra_keys=True,
        _cattrs_detailed_validation=True,
        **renamed,
    )

    def structure(value: Any, _: Any) -> Any:
        if isinstance(value, kind):
            return value
        table = as_table(value)
        try:
            return build(table, kind)
        except ClassValidationError as error:
            found = error
        # cattrs has tried everything; an unknown key explains a missing one, so it goes first.
        _check_keys(table, keys.values())
        values, record = found.group_exceptions()
        for why, note in values:
            key = keys[note.name]
            if key not in table:
                raise InvalidValue.missing(key, _words(hints[note.name]))
            if isinstance(why, InvalidValue):
                raise why.under(key)
            raise why
        if isinstance(record[0], SteerlabError):
            raise InvalidValue.refused(table, record[0])
        raise record[0]

    return structure


def _keys(kind: Any) -> dict[str, str]:
    """What each field is called in files."""
    return {field.name: field.metadata.get("key", field.name) for field in fields(kind)}


def _check_keys(table: Mapping[str, Any], known: Collection[str]) -> None:
    for key, value in table.items():
        if key not in known:
            raise InvalidValue(_step(key), value, f"under one of the keys {one_of(known, key)}")


def _words(kind: Any) -> str:
    """What may be there."""
    parts = get_args(kind)
    if get_origin(kind) is Literal or isinstance(kind, EnumType):
        return f"one of {', '.join(map(str, parts or kind))}"
    if get_origin(kind) is tuple:
        some = "a list" if parts[-1] is ... else f"a list of {len(parts)}"
        return f"{some}: {_words(parts[0])} each"
    if get_origin(kind) in (Union, UnionType):
        return " or ".join(_words(one) for one in parts if one is not NoneType)
    return _WORDS.get(kind, "a table of keys and values")


def _step(key: str) -> str:
    """The way to a key from the table that has it."""
    return key if re.fullmatch(r"[\w\-]+", key) else f"[{shown(key)}]"


def _each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {key!r} is there twice")
        found[key] = value
    return found
