"""The words of pages and windows in a study's language, from gettext catalogues over the English text."""

from functools import cache
from importlib.resources import files
from typing import TypeVar

import polib

from steerlab.sim.errors import InvalidValue, SteerlabError

ENGLISH = "en"
LANGUAGES = (ENGLISH, "de")
Words = TypeVar("Words", str, dict[str, str], tuple[str, ...])

_spoken = ENGLISH


class MissingText(SteerlabError):
    """A catalogue has no translation of a text."""

    def __init__(self, language: str, text: str) -> None:
        super().__init__(
            f"The catalogue {language}.po has no translation of {text[:80]!r}; add it, or give the "
            f"protocol language = {ENGLISH!r}."
        )


def speak(language: str) -> None:
    """Say everything in that language from now on, in this process.

    Raises:
        InvalidValue: there is no such catalogue.
    """
    global _spoken
    if language not in LANGUAGES:
        raise InvalidValue("language", language, f"one of {', '.join(LANGUAGES)}")
    _spoken = language


def said(english: Words) -> Words:
    """The text, or each text of a dictionary or tuple, in the language that is spoken.

    Raises:
        MissingText: the catalogue lacks it.
    """
    if _spoken == ENGLISH:
        return english
    if isinstance(english, dict):
        return {key: said(text) for key, text in english.items()}
    if isinstance(english, tuple):
        return tuple(said(text) for text in english)
    return translation(_spoken, english)


def translation(language: str, english: str) -> str:
    """One text in that language.

    Raises:
        MissingText: the catalogue lacks it.
    """
    known = catalogue(language)
    if english not in known:
        raise MissingText(language, english)
    return known[english]


@cache
def catalogue(language: str) -> dict[str, str]:
    """All translations into a language that are there and not marked as fuzzy."""
    text = (files("steerlab.assets") / "texts" / f"{language}.po").read_text(encoding="utf-8")
    return {entry.msgid: entry.msgstr for entry in polib.pofile(text) if entry.translated()}
