"""From a TOML table to a frozen dataclass: keys, types and values checked against its fields."""

import difflib
from collections.abc import Sequence
from dataclasses import MISSING, fields
from enum import EnumType
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from steerlab.sim.errors import InvalidConfig
from steerlab.study.contract import StudyError
from steerlab.study.protocol_error import ProtocolError

Record = TypeVar("Record")
_WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    dict: "a table",
    list: "a list",
}


def record_from_table(kind: type[Record], given: object, place: str) -> Record:
    """A record of ``kind`` from the table at ``place``, such as ``phases[3]``.

    Raises:
        ProtocolError: a key is unknown or missing, or a value is not what it may be.
        StudyError: the record itself refuses, in words of its own.
    """
    table = table_at(given, place)
    hints = get_type_hints(kind)
    names = [field.name for field in fields(kind)]  # pyright: ignore[reportArgumentType]
    check_keys(table, names, place)
    values: dict[str, Any] = {}
    for field in fields(kind):  # pyright: ignore[reportArgumentType]
        where = f"{place}.{field.name}"
        if field.name in table:
            values[field.name] = value_of(hints[field.name], table[field.name], where)
        elif field.default is MISSING and field.default_factory is MISSING:
            raise ProtocolError(where, None, f"given: {_words(hints[field.name])}")
    try:
        return kind(**values)
    except ProtocolError as error:
        raise error.under(place) from None
    except InvalidConfig as error:
        raise StudyError(f"{place}: {error}") from error


def check_keys(table: dict[str, Any], names: Sequence[str], place: str) -> None:
    """Refuse keys that are none of ``names``.

    Raises:
        ProtocolError: there is one; says which was probably meant.
    """
    dot = f"{place}." if place else ""
    for key, value in table.items():
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            allowed = f"under one of the keys {', '.join(names)}{hint}"
            raise ProtocolError(f"{dot}{key}", value, allowed)


def table_at(given: object, place: str) -> dict[str, Any]:
    """``given`` as a table.

    Raises:
        ProtocolError: it is none.
    """
    if not isinstance(given, dict):
        raise ProtocolError(place, given, "a table")
    return given


def records_at(kind: type[Record], given: object, place: str) -> tuple[Record, ...]:
    """Records from an array of tables; the first is at ``place[1]``."""
    if not isinstance(given, list):
        raise ProtocolError(place, given, f"tables under [[{place}]]")
    return tuple(
        record_from_table(kind, one, f"{place}[{number}]") for number, one in enumerate(given, 1)
    )


def value_of(hint: Any, given: object, place: str) -> Any:
    """``given`` as a value of the type ``hint``.

    Raises:
        ProtocolError: it is none.
    """
    origin = get_origin(hint)
    if origin is tuple:
        item = get_args(hint)[0]
        if not isinstance(given, list):
            raise ProtocolError(place, given, f"a list: {_words(item)} each")
        if isinstance(item, type) and hasattr(item, "__dataclass_fields__"):
            return records_at(item, given, place)
        return tuple(value_of(item, one, f"{place}[{n}]") for n, one in enumerate(given, 1))
    if origin is UnionType:  # ``int | None``: TOML has no null, so the key is left out for None
        (hint,) = (one for one in get_args(hint) if one is not type(None))
        return value_of(hint, given, place)
    if origin is Literal or isinstance(hint, EnumType):
        options = list(get_args(hint)) if origin is Literal else [*hint]
        if given not in options:
            raise ProtocolError(place, given, _words(hint))
        return given if origin is Literal else hint(given)
    kinds = (int, float) if hint is float else (hint,)
    if type(given) not in kinds:  # a bool is an int to isinstance
        raise ProtocolError(place, given, _words(hint))
    return float(given) if hint is float else given  # pyright: ignore[reportArgumentType]


def _words(hint: Any) -> str:
    origin = get_origin(hint)
    if origin is tuple:
        return f"a list: {_words(get_args(hint)[0])} each"
    if origin is Literal:
        return f"one of {', '.join(map(str, get_args(hint)))}"
    if isinstance(hint, EnumType):
        return f"one of {', '.join(map(str, hint))}"
    return _WORDS.get(hint, "a table")
