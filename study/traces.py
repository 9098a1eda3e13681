"""What lies of a participant outside the database: files named after them, and what is derived."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from steerlab.sim.files.folder_lock import CONSOLE_LOCK, RUN_LOCK, holder_name
from steerlab.study.contract import StudyError
from steerlab.study.frozen_files import MODELS
from steerlab.study.opened import DATABASE
from steerlab.study.protocol_file import PROTOCOL_FILE, QUESTIONNAIRES
from steerlab.study.recording.session_recorder import RECORDINGS

DERIVED = ("exports", "report")
"""Folders of a study that hold nothing but what can be made anew from the database."""

_KNOWN = (
    *(DATABASE, f"{DATABASE}-wal", f"{DATABASE}-shm", PROTOCOL_FILE, QUESTIONNAIRES),
    *(RECORDINGS, MODELS, *DERIVED),
    *(RUN_LOCK, CONSOLE_LOCK, holder_name(RUN_LOCK), holder_name(CONSOLE_LOCK)),
)


def traces(folder: Path, participant: str) -> list[Path]:
    """Files and folders under ``recordings`` and ``models`` that carry the participant's pseudonym.

    Such as ``recordings/P001-calibration-05-0.rrd``, whole or in parts, and networks with their w.
    Empty once they are erased.
    """
    named = re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")
    found: list[Path] = []
    for part in (RECORDINGS, MODELS):
        for path in sorted((folder / part).rglob("*")):  # a folder comes before what is in it
            if named.search(path.name) and not set(path.parents) & set(found):
                found.append(path)
    return found


def derived(folder: Path) -> list[Path]:
    """Exports and reports: they hold everybody's data, so they go when anybody's do.

    With them what ``output_folder`` leaves beside them if it is cut off.
    """
    found = [path for name in DERIVED for path in sorted(folder.glob(f".{name}-*"))]
    return found + [
        path for name in DERIVED if (path := folder / name).exists() or path.is_symlink()
    ]


def strangers(folder: Path) -> Iterator[Path]:
    """What steerlab did not put into the folder, and never touches."""
    for path in sorted(folder.iterdir()):
        if path.name not in _KNOWN:
            yield path


def delete(path: Path) -> None:
    """Delete a file, or a folder with all that is in it.

    Raises:
        StudyError: it cannot be deleted, or leads out of the study.
    """
    try:
        if path.is_symlink():
            raise StudyError(
                f"{path} is a link to {path.readlink()}, which steerlab does not touch. Delete "
                f"what is there and the link, then withdraw the participant again."
            )
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    except OSError as error:
        raise StudyError(
            f"Cannot delete {path}: {error.strerror or error}. Mend that, then withdraw the "
            f"participant again."
        ) from error
