"""What may be answered to an item: a point on a scale, an option, a number, a text, a slider."""

from dataclasses import dataclass
from math import ceil, floor, isfinite
from typing import ClassVar, Literal

from steerlab.sim.errors import InvalidValue, SteerlabError, check_words

Value = str | int | float
"""An answer: a number on a scale, a chosen option's value or a text."""

Kind = Literal["likert", "choice", "number", "text", "slider"]

LONGEST_LIKERT = 11
LONGEST_TEXT = 10_000
LONGEST_NUMBER = 32  # characters


class InvalidAnswer(SteerlabError, ValueError):
    """An answer is not one of those an item allows.

    Attributes:
        item: its id.
        value: what was answered.
        allowed: what is allowed, in words.
    """

    def __init__(self, item: str, value: object, allowed: str) -> None:
        self.item, self.value, self.allowed = item, value, allowed
        shown = repr(value)
        shown = shown if len(shown) <= 80 else f"{shown[:76]}...'"
        super().__init__(f"The answer to {item!r} is {shown}; it must be {allowed}.")


@dataclass(frozen=True, kw_only=True, slots=True)
class Likert:
    """One of the whole numbers from ``low`` to ``high``.

    Attributes:
        anchors: (value, words); both ends have some, those between may.
    """

    low: int
    high: int
    anchors: tuple[tuple[int, str], ...]

    kind: ClassVar[Kind] = "likert"

    def __post_init__(self) -> None:
        if not self.low < self.high < self.low + LONGEST_LIKERT:
            raise InvalidValue(
                "high", self.high, f"above low ({self.low}), with at most {LONGEST_LIKERT} points"
            )
        values = [value for value, _ in self.anchors]
        allowed = f"words for both ends ({self.low} and {self.high}), each value at most once"
        if len(set(values)) != len(values) or not {self.low, self.high} <= set(values):
            raise InvalidValue("anchors", dict(self.anchors), allowed)
        for value, words in self.anchors:
            if not self.low <= value <= self.high:
                allowed = f"words for values from {self.low} to {self.high}"
                raise InvalidValue("anchors", value, allowed)
            check_words(f"anchors.{value}", words)

    @property
    def allowed(self) -> str:
        """In words."""
        return f"a whole number from {self.low} to {self.high}"

    @property
    def points(self) -> tuple[tuple[int, str], ...]:
        """Every value with its words, which are empty where it has none."""
        words = dict(self.anchors)
        return tuple((value, words.get(value, "")) for value in range(self.low, self.high + 1))

    def accept(self, value: object) -> int | None:
        """The answer as kept; None if it is not allowed."""
        number = whole_number(value)
        return number if number is not None and self.low <= number <= self.high else None


@dataclass(frozen=True, kw_only=True, slots=True)
class Slider:
    """A number from ``low`` to ``high`` in steps, with words at the ends; as in the raw TLX."""

    low: int = 0
    high: int = 100
    step: int = 5
    low_label: str
    high_label: str

    kind: ClassVar[Kind] = "slider"

    def __post_init__(self) -> None:
        if self.low >= self.high:
            raise InvalidValue("high", self.high, f"above low ({self.low})")
        if self.step < 1 or (self.high - self.low) % self.step:
            allowed = f"a whole number that divides the range {self.low} to {self.high}"
            raise InvalidValue("step", self.step, allowed)
        for name, words in (("low_label", self.low_label), ("high_label", self.high_label)):
            check_words(name, words)

    @property
    def allowed(self) -> str:
        """In words."""
        return f"a number from {self.low} to {self.high} in steps of {self.step}"

    def accept(self, value: object) -> int | None:
        """The answer as kept; None if it is not allowed."""
        number = whole_number(value)
        if number is None or not self.low <= number <= self.high:
            return None
        return None if (number - self.low) % self.step else number


@dataclass(frozen=True, kw_only=True, slots=True)
class Option:
    """An option to choose: the value that is kept, and the text that people read."""

    value: str
    text: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """One of several options."""

    options: tuple[Option, ...]

    kind: ClassVar[Kind] = "choice"

    def __post_init__(self) -> None:
        values = [option.value for option in self.options]
        if len(values) < 2 or len(set(values)) != len(values):
            raise InvalidValue("options", values, "two or more options with other values")
        for index, option in enumerate(self.options):
            key = f"options[{index}]"
            if not option.value or option.value != option.value.strip():
                raise InvalidValue(f"{key}.value", option.value, "a word without spaces around")
            check_words(f"{key}.text", option.text)

    @property
    def allowed(self) -> str:
        """In words."""
        return f"one of {', '.join(option.value for option in self.options)}"

    def accept(self, value: object) -> str | None:
        """The answer as kept; None if it is not allowed."""
        return next((option.value for option in self.options if option.value == value), None)


@dataclass(frozen=True, kw_only=True, slots=True)
class Number:
    """A number within bounds, such as an age.

    Attributes:
        unit: shown after the field; may be empty.
        whole: no fractions.
    """

    minimum: float
    maximum: float
    unit: str = ""
    whole: bool = True

    kind: ClassVar[Kind] = "number"

    def __post_init__(self) -> None:
        for name, bound in (("minimum", self.minimum), ("maximum", self.maximum)):
            if not isfinite(bound):
                raise InvalidValue(name, bound, "a finite number")
        if self.minimum >= self.maximum:
            raise InvalidValue("maximum", self.maximum, f"above minimum ({self.minimum:g})")
        if self.whole and ceil(self.minimum) > floor(self.maximum):
            raise InvalidValue("maximum", self.maximum, "such that a whole number is within")

    @property
    def allowed(self) -> str:
        """In words."""
        what = "a whole number" if self.whole else "a number"
        return f"{what} from {self.minimum:g} to {self.maximum:g}"

    def accept(self, value: object) -> int | float | None:
        """The answer as kept; None if it is not allowed."""
        number = whole_number(value) if self.whole else _number(value)
        return number if number is not None and self.minimum <= number <= self.maximum else None


@dataclass(frozen=True, kw_only=True, slots=True)
class FreeText:
    """Free text of up to ``longest`` characters."""

    longest: int = 500

    kind: ClassVar[Kind] = "text"

    def __post_init__(self) -> None:
        if not 1 <= self.longest <= LONGEST_TEXT:
            raise InvalidValue("longest", self.longest, f"from 1 to {LONGEST_TEXT} characters")

    @property
    def allowed(self) -> str:
        """In words."""
        return f"a text of 1 to {self.longest} characters, without control characters"

    def accept(self, value: object) -> str | None:
        """The answer as kept, without blanks around it; None if it is not allowed."""
        if not isinstance(value, str):
            return None
        text = value.replace("\r\n", "\n").strip()  # browsers send both
        if not 1 <= len(text) <= self.longest:
            return None
        return text if all(char in "\n\t" or _is_writable(char) for char in text) else None


AnswerFormat = Likert | Slider | Choice | Number | FreeText


def whole_number(value: object) -> int | None:
    """``value`` as a whole number, which a form sends as digits; None if it is none."""
    number = _number(value)
    return int(number) if number is not None and number == int(number) else None


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return None
    if isinstance(value, str) and (
        len(value) > LONGEST_NUMBER or not value.strip().isascii() or "_" in value
    ):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if isfinite(number) else None


def _is_writable(character: str) -> bool:
    """Neither a control character nor half of a pair, which no UTF-8 file can hold."""
    code = ord(character)
    return code >= 0x20 and not 0x7F <= code < 0xA0 and not 0xD800 <= code < 0xE000
