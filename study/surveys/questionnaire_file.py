"""Where questionnaires are: the shipped ones, and those that a study's folder brings."""

import re
from functools import cache
from importlib import resources
from pathlib import Path

from steerlab.sim.errors import InvalidConfig
from steerlab.study.surveys.errors import QuestionnaireError
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.questionnaire_toml import questionnaire_from_toml
from steerlab.study.surveys.toml_lines import line_of


def shipped_questionnaires() -> dict[str, Questionnaire]:
    """Those that come with the program, by key."""
    return dict(_shipped())


def all_questionnaires(folder: Path | None = None) -> dict[str, Questionnaire]:
    """The shipped ones and those of a study's folder, by key.

    Args:
        folder: holds one ``<key>.toml`` for each of the study's own; None for the shipped alone.

    Raises:
        InvalidConfig: a file is wrong, or brings a key that a shipped questionnaire has: a study
            never changes a known instrument under its name.
    """
    found = shipped_questionnaires()
    for path in _files(folder):
        if path.stem in found:
            raise InvalidConfig(
                f"{path} has the key of a shipped questionnaire, which it would replace; give "
                f"file and key another name, such as {path.stem}_ours."
            )
        found[path.stem] = _read(path)
    return found


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


@cache
def _shipped() -> tuple[tuple[str, Questionnaire], ...]:
    folder = resources.files("steerlab.assets") / "questionnaires"
    files = sorted(
        (one for one in folder.iterdir() if one.name.endswith(".toml")), key=lambda one: one.name
    )
    return tuple(
        (one.name.removesuffix(".toml"), _named(one.read_text(encoding="utf-8"), one.name))
        for one in files
    )


def _files(folder: Path | None) -> list[Path]:
    if folder is None:
        return []
    if not folder.is_dir():
        raise InvalidConfig(f"{folder} is no folder; make it, or ask for shipped questionnaires.")
    return sorted(folder.glob("*.toml"))


def _read(path: Path) -> Questionnaire:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InvalidConfig(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise InvalidConfig(f"{path} is not UTF-8: {error}. Save it as UTF-8.") from error
    return _named(text, str(path))


def _named(text: str, file: str) -> Questionnaire:
    """A questionnaire whose file has its key as name, so that no folder holds a key twice."""
    found = questionnaire_from_toml(text, file)
    name = re.split(r"[/\\]", file)[-1].removesuffix(".toml")
    if found.key != name:
        error = QuestionnaireError("key", found.key, f"{name!r}, as the file is named")
        raise error.at(file, line_of(text, "key"))
    return found
