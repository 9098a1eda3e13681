"""Frozen dataclasses as rows of the study database, and back: each field has a column of its name.

The type hints decide how. SQLite holds ``str``, ``int``, ``float``, ``bool``, ``bytes`` and members
of a ``StrEnum`` as they are, and None as null. All else is kept as JSON: tuples, mappings with
texts as keys, arrays of floats, unions of scalars, and types with ``to_dict`` and ``from_dict``.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property
from math import isfinite
from operator import index
from reprlib import repr as short
from textwrap import shorten
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from steerlab.sim.records import InvalidRecord
from steerlab.study.store.errors import StoreError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from steerlab.study.store.connection import StoreConnection

    Record = TypeVar("Record", bound=DataclassInstance)
else:
    Record = TypeVar("Record")

Stored = str | int | float | bytes | None
"""What SQLite holds in a column."""


@dataclass(frozen=True)
class Table(Generic[Record]):
    """A table of the database that holds records of one type, a row each.

    Attributes:
        joined: fields that are columns of another table, which ``select`` then has to join.
    """

    name: str
    record: type[Record]
    joined: tuple[str, ...] = ()

    def to_row(self, record: Record) -> dict[str, Stored]:
        """What is stored of a record, by column.

        Raises:
            InvalidRecord: a value is of another type than its field, not finite, too large, or no
                text that can be written.
        """
        row: dict[str, Stored] = {}
        for name, hint, how in self._columns:
            if name not in self.joined:
                value = getattr(record, name)
                try:
                    row[name] = how.store(value)
                except (TypeError, ValueError, AttributeError) as error:
                    raise InvalidRecord(
                        f"{self.name}.{name} cannot be {short(value)} ({error}); give {_words(hint)}."
                    ) from error
        return row

    def from_row(self, row: tuple[Any, ...]) -> Record:
        """The record of a row whose columns stand in the order of the fields.

        Raises:
            StoreError: the database holds something that the field cannot be.
        """
        values: dict[str, Any] = {}
        for (name, hint, how), stored in zip(self._columns, row, strict=True):
            try:
                values[name] = how.load(stored)
            except Exception as error:  # anything may be in a damaged cell
                raise StoreError(
                    f"{self.name}.{name} is {short(stored)} in the database "
                    f"({shorten(str(error) or type(error).__name__, 80)}), where it must be {_words(hint)}; restore "
                    "the study folder from its last copy."
                ) from error
        return self.record(**values)

    def insert(self, connection: "StoreConnection", record: Record, **others: Stored) -> None:
        """Add a record as a new row, and ``others``, which it has no fields for; in a transaction.

        Raises:
            InvalidRecord: as ``to_row``.
        """
        connection.insert(self.name, **self.to_row(record), **others)

    def select(self, connection: "StoreConnection", tail: str, *values: Stored) -> list[Record]:
        """Records of the rows that ``tail`` picks: the SQL after the table's name.

        Raises:
            StoreError: the file cannot be read, or as ``from_row``.
        """
        return [self.from_row(row) for row in connection.read(self.query(tail), *values)]

    def query(self, tail: str) -> str:
        """The SQL of ``select``."""
        return f"SELECT {', '.join(name for name, *_ in self._columns)} FROM {self.name} {tail}"

    @cached_property
    def _columns(self) -> "list[tuple[str, Any, _Codec]]":
        hints = get_type_hints(self.record)
        names = [field.name for field in fields(self.record)]
        return [(name, hints[name], _codec(hints[name])) for name in names]


@dataclass(frozen=True)
class _Codec:
    """How values of a type become plain values, as JSON has them, and back.

    Attributes:
        scalar: SQLite can hold the plain value without JSON.
    """

    plain: Callable[[Any], Any]
    typed: Callable[[Any], Any]
    scalar: bool = False

    def store(self, value: Any) -> Stored:
        plain = self.plain(value)
        if plain is None or self.scalar:
            return plain
        return _text(json.dumps(plain, ensure_ascii=False, sort_keys=True, allow_nan=False))

    def load(self, stored: Stored) -> Any:
        if stored is None or self.scalar:
            return self.typed(stored)
        return self.typed(json.loads(_text(stored)))


def _codec(hint: Any) -> _Codec:
    origin, args = get_origin(hint), get_args(hint)
    if hint in _SCALARS:
        return _SCALARS[hint]
    if origin in (Union, UnionType):
        kinds = [arg for arg in args if arg is not NoneType]
        how = _codec(kinds[0]) if len(kinds) == 1 else _any_of(kinds)
        if NoneType not in args:
            return how
        return _Codec(_or_none(how.plain), _or_none(how.typed), how.scalar)
    if origin is tuple:
        return _tuple(args)
    if origin is np.ndarray:
        return _Codec(_numbers, lambda plain: np.array(plain, dtype=np.float64))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        each = _codec(args[1])
        return _Codec(
            lambda value: {_text(key): each.plain(item) for key, item in value.items()},
            lambda plain: {key: each.typed(item) for key, item in plain.items()},
        )
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _Codec(lambda value: hint(value).value, hint, scalar=True)
    return _Codec(hint.to_dict, hint.from_dict)


def _or_none(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: None if value is None else convert(value)


def _any_of(kinds: list[type]) -> _Codec:
    """One of several scalars: kept as JSON, which tells them apart."""

    def check(value: Any) -> Any:
        kind = next((kind for kind in kinds if isinstance(value, kind)), None)
        if kind is None:
            raise TypeError(f"no {' or '.join(map(_words, kinds))}")
        return _SCALARS[kind].plain(value)

    return _Codec(check, check)


def _tuple(args: tuple[Any, ...]) -> _Codec:
    if args[-1] is Ellipsis:
        item = _codec(args[0])
        return _Codec(lambda v: [*map(item.plain, v)], lambda v: tuple(map(item.typed, v)))
    each = [_codec(arg) for arg in args]
    return _Codec(
        lambda value: [how.plain(item) for how, item in zip(each, value, strict=True)],
        lambda plain: tuple(how.typed(item) for how, item in zip(each, plain, strict=True)),
    )


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError("no text")
    value.encode()  # a lone surrogate raises, as it would in SQLite
    return str(value)


def _bytes(value: Any) -> bytes:
    if not isinstance(value, bytes):
        raise TypeError("no bytes")
    return value


def _whole(value: Any) -> int:
    number = index(value)
    if isinstance(value, bool) or not -(2**63) <= number < 2**63:
        raise ValueError("no whole number of 64 bits")
    return number


def _finite(value: Any) -> float:
    if isinstance(value, (str, bytes, bool)) or not isfinite(number := float(value)):
        raise ValueError("no finite number")
    return number


def _truth(value: Any) -> bool:
    if value not in (0, 1):
        raise ValueError("neither true nor false")
    return bool(value)


def _numbers(value: Any) -> Any:
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ValueError("not all numbers are finite")
    return array.tolist()


_CHECKS = {str: _text, bytes: _bytes, int: _whole, float: _finite, bool: _truth}
_SCALARS: dict[Any, _Codec] = {
    kind: _Codec(check, check, scalar=True) for kind, check in _CHECKS.items()
}


def _words(hint: Any) -> str:
    """A type in the words of an error, with its members if it is a short list."""
    if isinstance(hint, type) and issubclass(hint, Enum):
        return f"one of {', '.join(str(member.value) for member in hint)}"
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(map(_words, get_args(hint)))
    if get_origin(hint) is np.ndarray:
        return "an array of numbers"
    return "None" if hint is NoneType else getattr(hint, "__name__", str(hint))
