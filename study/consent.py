"""What participants agree to, what they enter beside their decision, and what is kept of it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from steerlab.sim.errors import InvalidValue, check_words

MOST_TICKS = 20
AGES_YEARS = (1, 120)
AGE, SIGNATURE = "age", "signature"
"""Names of what is lacking, beside those that ``tick`` gives."""


def tick(index: int) -> str:
    """The name of the ``index``-th statement, from 0."""
    return f"tick.{index}"


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsentText:
    """What participants agree to; whatever is changed in it needs a new version.

    Attributes:
        text: paragraphs, in Markdown.
        ticks: statements; who agrees ticks each of them.
        signature: who agrees types their name, which is shown on their copy and kept nowhere.
        minimum_age: who is younger, in years, does not take part; None asks for no age.
    """

    version: int
    text: tuple[str, ...]
    ticks: tuple[str, ...] = ()
    signature: bool = False
    minimum_age: int | None = None

    def __post_init__(self) -> None:
        if self.version < 1:
            raise InvalidValue("version", self.version, "a whole number from 1")
        if not self.text or not all(paragraph.strip() for paragraph in self.text):
            raise InvalidValue("text", list(self.text), "one or more paragraphs, none blank")
        if len(set(self.ticks)) != len(self.ticks) or len(self.ticks) > MOST_TICKS:
            allowed = f"statements that differ, {MOST_TICKS} at most"
            raise InvalidValue("ticks", list(self.ticks), allowed)
        for index, statement in enumerate(self.ticks):
            check_words(f"ticks[{index}]", statement)
        low, high = AGES_YEARS
        if self.minimum_age is not None and not low <= self.minimum_age <= high:
            raise InvalidValue("minimum_age", self.minimum_age, f"from {low} to {high} years")

    @property
    def sha256(self) -> str:
        """Hash of all that was shown; of a text alone, of its paragraphs."""
        parts = list(self.text)
        if asked := self._asked():
            parts.append(json.dumps(asked, sort_keys=True, ensure_ascii=False))
        return sha256("\n\n".join(parts).encode()).hexdigest()

    def lacking(self, entries: "ConsentEntries") -> tuple[str, ...]:
        """What a yes needs and ``entries`` do not have, by name, in the order of the page."""
        lacking = [tick(index) for index in range(len(self.ticks)) if index not in entries.ticked]
        if self.minimum_age is not None and entries.of_age is None:
            lacking.append(AGE)
        if self.signature and not entries.signed:
            lacking.append(SIGNATURE)
        return tuple(lacking)

    @property
    def agreed(self) -> "ConsentEntries":
        """Entries that lack nothing, as scripts give them."""
        return ConsentEntries(
            ticked=frozenset(range(len(self.ticks))), of_age=True, signed=self.signature
        )

    def kept(self, entries: "ConsentEntries") -> str:
        """What is kept of the entries, as JSON: never a name; empty where nothing was asked."""
        kept: dict[str, Any] = {}
        if self.ticks:
            kept["ticked"] = sorted(index for index in entries.ticked if index < len(self.ticks))
        if self.minimum_age is not None and entries.of_age is not None:
            kept["of_age"] = entries.of_age
        if self.signature:
            kept["signed"] = entries.signed
        return json.dumps(kept) if kept else ""

    def _asked(self) -> dict[str, Any]:
        asked = {"ticks": self.ticks, "signature": self.signature, "minimum_age": self.minimum_age}
        return {name: value for name, value in asked.items() if value}


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsentEntries:
    """What was entered beside the decision.

    Attributes:
        ticked: the statements that were ticked, counted from 0.
        of_age: whether they said to be as old as ``minimum_age``; None: they did not say.
        signed: a name was typed.
    """

    ticked: frozenset[int] = frozenset()
    of_age: bool | None = None
    signed: bool = False

    @classmethod
    def read(cls, kept: str) -> "ConsentEntries":
        """From what ``ConsentText.kept`` gave."""
        values: Mapping[str, Any] = json.loads(kept) if kept else {}
        return cls(
            ticked=frozenset(values.get("ticked", ())),
            of_age=values.get("of_age"),
            signed=values.get("signed", False),
        )


NO_ENTRIES = ConsentEntries()


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsentRecord:
    """A decision.

    Attributes:
        text: on which it was made.
        at_utc: when; ISO 8601.
    """

    text: ConsentText
    given: bool
    at_utc: str
    entries: ConsentEntries

    @property
    def ticked(self) -> tuple[str, ...]:
        """The statements that were ticked."""
        ticks = self.text.ticks
        return tuple(ticks[index] for index in range(len(ticks)) if index in self.entries.ticked)

    @property
    def too_young(self) -> bool:
        """They said to be younger than the text's minimum age, so the answer is no."""
        return self.text.minimum_age is not None and self.entries.of_age is False
