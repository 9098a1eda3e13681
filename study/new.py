"""Making a study: a folder with a protocol to edit, and an empty database."""

from importlib import resources
from pathlib import Path

from steerlab.study.contract import StudyError
from steerlab.study.opened import DATABASE
from steerlab.study.protocol_file import PROTOCOL_FILE, parse_protocol, study_questionnaires
from steerlab.study.store.store import StudyStore


def template_names() -> list[str]:
    """The shipped protocols."""
    folder = resources.files("steerlab.assets") / "study_templates"
    names = (file.name for file in folder.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def new_study(folder: Path, template: str) -> None:
    """Write ``study.toml`` and an empty ``study.db`` into a folder, which is made if need be.

    Raises:
        StudyError: there is no such template, the folder holds a study, or it cannot be written.
    """
    if template not in template_names():
        raise StudyError(f"No template {template!r}; choose one of {', '.join(template_names())}.")
    for name in (PROTOCOL_FILE, DATABASE):
        if (folder / name).exists():
            raise StudyError(f"{folder / name} exists already; choose another folder.")
    source = resources.files("steerlab.assets") / "study_templates" / f"{template}.toml"
    text = source.read_text(encoding="utf-8")
    parse_protocol(text, source.name, study_questionnaires(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / PROTOCOL_FILE).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StudyError(
            f"Cannot write into {folder}: {error.strerror or error}; choose another folder."
        ) from error
    StudyStore.create(folder / DATABASE).close()
