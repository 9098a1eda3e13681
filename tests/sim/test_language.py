"""Catalogues: complete, with the same placeholders, and nothing is said in two languages at once."""

import ast
import string
from collections.abc import Iterator
from pathlib import Path

import pytest

from steerlab.app.console import texts
from steerlab.learning.agents.teaching import REMEMBERING, TRYING
from steerlab.sim import language
from steerlab.sim.errors import InvalidValue
from steerlab.sim.language import ENGLISH, LANGUAGES, MissingText, catalogue, said, speak
from steerlab.study.surveys.questionnaire import Language
from steerlab.study.teaching.conditions import FIRST_BEFORE, FIRST_DURING, TAUGHT
from steerlab.teleop import page_prompt, pages
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.screen import confirm, hud

ROOT = Path(__file__).parents[2]
OTHERS = [one for one in LANGUAGES if one != ENGLISH]


@pytest.fixture(autouse=True)
def english_again():
    yield
    speak(ENGLISH)


def _console_texts() -> Iterator[str]:
    for name, value in vars(texts).items():
        if name.isupper():
            yield from value.values() if isinstance(value, dict) else [value]


def _window_texts() -> Iterator[str]:
    """What the code gives to ``said`` as it stands there."""
    for path in [*(ROOT / "teleop").rglob("*.py"), *(ROOT / "study").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "said":
                for part in ast.walk(node.args[0]):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str):
                        yield part.value


def _later_texts() -> Iterator[str]:
    """Constants that are said where they are shown."""
    yield from (FIRST_DURING, *FIRST_BEFORE, SessionConfig().instruction, REMEMBERING, TRYING)
    for mode in TAUGHT.values():
        yield from (*mode.before, mode.during)
    yield from (*confirm.QUESTIONS.values(), *page_prompt._OR_BUTTON.values())
    yield from (*pages.OUTCOMES.values(), *pages._PAUSES.values(), pages.ROLLOUT, pages.BALL)
    for _, does in (pages.GO_ON, pages.AGAIN, pages.STOP, pages._CLOSE, pages._STOP_PRACTISING):
        yield does
    yield from (does for _, does in hud._KEYS)
    yield from (words for words, _, _ in hud._ENDS.values())
    yield from ("left", "right", "Drive to the orange ball.")


def _fields(text: str) -> list[str]:
    return sorted(name for _, name, _, _ in string.Formatter().parse(text) if name)


@pytest.mark.parametrize("spoken", OTHERS)
def test_a_catalogue_has_every_text_with_its_fields(spoken):
    known = catalogue(spoken)
    wanted = {*_console_texts(), *_window_texts(), *_later_texts()}
    assert sorted(wanted - set(known)) == []
    assert [text for text in known if _fields(text) != _fields(known[text])] == []
    assert sorted(set(known) - wanted) == []  # nothing is left of texts that are gone


def test_pages_are_said_in_the_language_that_is_spoken():
    speak("de")
    assert texts.NEXT == "Weiter"
    assert texts.STANDING["finished"] == "fertig"
    assert said(("Continue", "Back")) == ("Weiter", "Zurück")
    speak(ENGLISH)
    assert texts.NEXT == "Continue"


def test_a_language_without_a_catalogue_is_refused():
    with pytest.raises(InvalidValue, match="language is 'fr'; it must be one of en, de"):
        speak("fr")


def test_a_missing_text_is_named_with_its_mend(monkeypatch):
    monkeypatch.setattr(language, "catalogue", lambda spoken: {})
    speak("de")
    with pytest.raises(MissingText, match=r"de\.po has no translation of 'Continue'; add it, or"):
        assert texts.NEXT


def test_protocols_can_name_exactly_these_languages():
    assert Language.__args__ == LANGUAGES
