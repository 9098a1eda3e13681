"""Typed reading of foreign JSON: each error names the place, what is there, and what belongs."""

import json
from math import isfinite
from typing import Any, Self

from steerlab.sim.errors import SteerlabError


class InvalidSummary(SteerlabError, ValueError):
    """A summary lacks a value, or holds one that cannot be."""


class JsonReader:
    """One value of a JSON text, and where it stands: ``splits.new.ci95``."""

    def __init__(self, value: Any, place: str = "") -> None:
        self.value = value
        self.place = place

    @classmethod
    def of_text(cls, text: str) -> Self:
        """The whole of a JSON text.

        Raises:
            InvalidSummary: the text is no JSON.
        """
        try:
            return cls(json.loads(text))
        except ValueError as error:
            raise InvalidSummary(f"Not a summary: the text is no JSON ({error}).") from error

    def __getitem__(self, key: str) -> "JsonReader":
        values = self._expect(dict, "an object")
        if key not in values:
            raise InvalidSummary(f"{self._name} lacks {key!r}; it has {sorted(values)}.")
        return JsonReader(values[key], f"{self.place}.{key}".lstrip("."))

    def items(self) -> dict[str, "JsonReader"]:
        """The object's values by key."""
        return {key: self[key] for key in self._expect(dict, "an object")}

    def only(self, *keys: str) -> "JsonReader":
        """This object, if it holds no other keys."""
        if unknown := sorted(set(self._expect(dict, "an object")) - set(keys)):
            raise InvalidSummary(f"{self._name} has unknown {unknown}; it may have {[*keys]}.")
        return self

    def text(self) -> str:
        """This value, a string."""
        return self._expect(str, "a text")

    def integer(self) -> int:
        """This value, a whole number; true and false are none."""
        if isinstance(self.value, bool):
            self._refuse("a whole number")
        return self._expect(int, "a whole number")

    def number(self) -> float:
        """This value, a finite number; Python's JSON would also read NaN."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            self._refuse("a finite number")
        return float(value)

    def optional_number(self) -> float | None:
        """This value, a finite number or null."""
        return None if self.value is None else self.number()

    def pair(self) -> tuple[float, float]:
        """This value, a list of two numbers."""
        values = self._expect(list, "a list of two numbers")
        if len(values) != 2:
            self._refuse("a list of two numbers")
        low, high = (JsonReader(value, f"{self.place}[{i}]") for i, value in enumerate(values))
        return low.number(), high.number()

    @property
    def _name(self) -> str:
        return self.place or "The summary"

    def _expect(self, kind: type, what: str) -> Any:
        return self.value if isinstance(self.value, kind) else self._refuse(what)

    def _refuse(self, what: str) -> Any:
        shown = repr(self.value)
        shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
        raise InvalidSummary(f"{self._name} is {shown}; give {what}.")
