"""``Variable``: a column of an export, with all that a reader needs to use it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Literal

from steerlab.analysis.study_data.asked import Missing

Kind = Literal["text", "choice", "truth", "whole", "number", "time"]
"""``choice`` is one of some words, ``truth`` 0 or 1, ``time`` ISO 8601 in UTC as a text."""
Measure = Literal["nominal", "ordinal", "scale"]

LONGEST_NAME = 64  # bytes, as in SPSS, which has the strictest rules of those who read an export
_RESERVED = frozenset(
    (
        *(
            "all",
            "and",
            "by",
            "eq",
            "ge",
            "gt",
            "le",
            "lt",
            "ne",
            "not",
            "or",
            "to",
            "with",
        ),  # SPSS
        *("if", "else", "repeat", "while", "function", "for", "next", "break", "in"),  # R
        *("true", "false", "null", "inf", "nan", "na"),
    )
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Level:
    """One value of a variable, and what it means."""

    value: int | str
    label: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Source:
    """The item or the scale of a questionnaire that a variable comes from.

    Attributes:
        phase: in which it is asked.
        condition: after which it is asked; empty where it is about none.
        part: id of the item, or key of the scale.
        reversed_in: scales in which the item counts in reverse.
    """

    questionnaire: str
    version: int
    phase: str
    condition: str
    part: str
    reversed_in: tuple[str, ...]
    citation: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """A column.

    Attributes:
        name: as in every format: valid in SPSS and in R; see ``distinct``.
        label: what it is, in words.
        unit: as in the name's ending; empty without one.
        levels: all values of a ``choice`` or a ``truth``; of numbers, those that have words.
        low, high: the lowest and the highest value there can be; None where nothing bounds it.
        source: None for all that is no answer and no score.
        asked: it is an answer, so that its absence has a reason (``Missing``).
    """

    name: str
    label: str
    kind: Kind
    measure: Measure
    unit: str = ""
    levels: tuple[Level, ...] = ()
    low: float | None = None
    high: float | None = None
    source: Source | None = None
    asked: bool = False

    @property
    def codes(self) -> Mapping[int | str, int]:
        """The number of each level in SPSS: words are counted from 1, numbers stay."""
        return {
            level.value: level.value if isinstance(level.value, int) else index
            for index, level in enumerate(self.levels, start=1)
        }

    @property
    def missing_codes(self) -> Mapping[Missing, int]:
        """The number of each reason in SPSS: -99, -98, -97, or longer where answers go that low."""
        if not self.asked or self.kind == "text":
            return {}
        low = self.low if self.low is not None else 0.0
        nines = next(10**digits - 1 for digits in range(2, 16) if 3 - 10**digits < low)
        return {reason: index - nines for index, reason in enumerate(Missing)}


def truth(name: str, label: str, yes: str = "yes", no: str = "no") -> Variable:
    """A variable that is 1 or 0."""
    levels = (Level(value=0, label=no), Level(value=1, label=yes))
    return Variable(name=name, label=label, kind="truth", measure="nominal", levels=levels)


def number(
    name: str, label: str, unit: str = "", *, low: float | None = None, high: float | None = None
) -> Variable:
    """A measured number."""
    return Variable(
        name=name, label=label, kind="number", measure="scale", unit=unit, low=low, high=high
    )


def whole(name: str, label: str, unit: str = "") -> Variable:
    """A count."""
    return Variable(name=name, label=label, kind="whole", measure="scale", unit=unit)


def text(name: str, label: str) -> Variable:
    """Words that are no choice."""
    return Variable(name=name, label=label, kind="text", measure="nominal")


def time(name: str, label: str) -> Variable:
    """A moment."""
    return Variable(name=name, label=f"{label} (UTC)", kind="time", measure="nominal")


def choice(name: str, label: str, levels: Mapping[str, str]) -> Variable:
    """One of some words, with what each means."""
    return Variable(
        name=name,
        label=label,
        kind="choice",
        measure="nominal",
        levels=tuple(Level(value=value, label=words) for value, words in levels.items()),
    )


def column_name(*parts: str) -> str:
    """The parts as one name that SPSS and R take: letters, digits and ``_``, at most 64 bytes.

    A name that is too long ends in a hash of the whole of it.
    """
    whole = re.sub(r"[^A-Za-z0-9_]", "_", "_".join(part for part in parts if part)).rstrip("_")
    if not whole[:1].isalpha() or whole.lower() in _RESERVED:
        whole = f"x_{whole}".rstrip("_")
    if len(whole) > LONGEST_NAME:
        whole = f"{whole[: LONGEST_NAME - 9]}_{sha256(whole.encode()).hexdigest()[:8]}"
    return whole


def distinct(names: Sequence[str]) -> list[str]:
    """The names; one that is taken, in upper or lower case, gets a number: SPSS sees no case."""
    taken: set[str] = set()
    found: list[str] = []
    for name in names:
        free, count = name, 1
        while free.lower() in taken:
            count += 1
            free = f"{name[: LONGEST_NAME - 1 - len(str(count))]}_{count}"
        taken.add(free.lower())
        found.append(free)
    return found
