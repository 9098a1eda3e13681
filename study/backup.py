"""``study backup``: a copy of a study while it goes on: whole, its owner's alone, and checked."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from shlex import quote

from steerlab.sim.files.output_folder import output_folder
from steerlab.study.contract import StudyError
from steerlab.study.derived import DERIVED, ErasureGuard
from steerlab.study.protocol_file import PROTOCOL_FILE, QUESTIONNAIRES
from steerlab.study.recording.session_recorder import RECORDINGS
from steerlab.study.store.audit import AuditEntry, broken_at
from steerlab.study.store.copying import copy_database
from steerlab.study.store.people import Departure, read_departures
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.study.study_folder import MODELS, OpenStudy
from steerlab.study.verify import Verified, verify
from steerlab.study.withdrawal import unknown_files

_PARTS = ".*.part"  # what others are writing
_ANALYSIS = "analysis-*"  # networks of the analysis, which trains them anew


def backup(folder: Path, out: Path, *, derived: bool = False) -> Verified:
    """Copy the study in ``folder`` to ``out``, also while others write into it, and check the copy.

    An earlier backup of the same study is replaced by a whole one, or stays.

    Args:
        derived: also what can be made anew: recordings, exports, reports, networks of the analysis.

    Returns:
        what ``verify`` says of the copy.

    Raises:
        StudyError: ``out`` is part of the study or holds something else, an erasure is not
            finished, or the study is damaged and an earlier backup would be lost.
        SteerlabError: something cannot be read or written; what was at ``out`` stays.
    """
    study = OpenStudy.open(folder, read_only=True)
    with study.store:
        guard = ErasureGuard.of(folder)
        check_apart(folder, out)
        check_nobody_half_erased(study)
        earlier = _check_earlier(study, out)
        with output_folder(out, force=True, placing=guard.placing()) as fresh:
            with guard.reading():
                copy_study(study, fresh, derived=derived)
            if earlier:
                _check_sound(folder, fresh, out)
            keep_private(fresh)
    return check_copy(out)


def check_copy(out: Path) -> Verified:
    """What ``verify`` says of a copy that nobody else has open."""
    copy = OpenStudy.open(out)  # not read-only: SQLite then leaves no log beside it
    with copy.store:
        return verify(copy)


def copy_study(study: OpenStudy, target: Path, *, derived: bool = False) -> None:
    """Copy a study into an empty folder: first the database, then the files that it names.

    Files are put in place before the database names them, and keep their content.

    Raises:
        StoreError: the database cannot be read or its copy written.
        OSError: a file cannot be.
    """
    copy_database(study.store.connection, target / STUDY_FILE)
    if (study.folder / PROTOCOL_FILE).exists():  # verify misses it otherwise
        shutil.copyfile(study.folder / PROTOCOL_FILE, target / PROTOCOL_FILE)
    for name in (QUESTIONNAIRES, MODELS, *((RECORDINGS, *DERIVED) if derived else ())):
        copy_folder(study.folder / name, target / name, () if derived else (_ANALYSIS,))


def copy_folder(source: Path, target: Path, without: Sequence[str] = (_ANALYSIS,)) -> None:
    """Copy what is there of a folder into another, but for files that are being written.

    Raises:
        OSError: a file cannot be read or written.
    """
    failures: list[OSError] = []

    def copy(file: str, to: str) -> None:
        try:
            shutil.copyfile(file, to)
        except OSError as error:  # copytree keeps its words alone, and goes on
            failures.append(error)
            raise

    if source.is_dir():
        left_out = shutil.ignore_patterns(_PARTS, *without)
        try:
            shutil.copytree(source, target, ignore=left_out, dirs_exist_ok=True, copy_function=copy)
        except shutil.Error as error:
            raise (failures or [error])[0] from None


def keep_private(folder: Path) -> None:
    """Let nobody but its owner into a folder and all that is in it."""
    folder.chmod(0o700)
    for path in folder.rglob("*"):
        path.chmod(0o700 if path.is_dir() else 0o600)


def check_apart(folder: Path, out: Path) -> None:
    """Refuse a copy that would lie in the study, or replace it.

    Raises:
        StudyError: it would.
    """
    home, place = (Path(os.path.realpath(path)) for path in (folder, out))
    if place.is_relative_to(home) or home.is_relative_to(place):
        raise StudyError(
            f"{out} is the folder of the study {folder}, lies in it or holds it; choose another "
            "folder, for a backup best on another disk."
        )


def check_nobody_half_erased(study: OpenStudy) -> None:
    """Refuse to copy what is on its way out.

    Raises:
        StudyError: an erasure was begun and is not finished.
    """
    departures = read_departures(study.store.connection)
    for who, how in departures.items():
        if how is Departure.ERASING:
            raise StudyError(
                f"The erasure of {who} is not finished, and a copy would keep what is to go. First "
                f"run: steerlab study withdraw {quote(str(study.folder))} {who} --erase"
            )


def _check_earlier(study: OpenStudy, out: Path) -> bool:
    """Whether ``out`` holds an earlier backup of the study.

    Raises:
        StudyError: it holds something else, which a new backup would replace.
    """
    if not out.is_dir() or not any(out.iterdir()):
        return False
    another = "choose another folder for this backup."
    if not (out / STUDY_FILE).is_file():
        raise StudyError(f"{out} is not empty and holds no backup of a study; {another}")
    if unknown := unknown_files(out):
        names = ", ".join(path.name for path in unknown)
        raise StudyError(f"{out} holds {names}, which a new backup would remove; {another}")
    with StudyStore.open(out / STUDY_FILE) as store:  # to be replaced, so it must be writable
        there = store.audit()
    if not _is_earlier(study, out, there):
        raise StudyError(
            f"{out} holds another study, or this one in a state that {study.folder} never had; "
            f"{another}"
        )
    return True


def _is_earlier(study: OpenStudy, out: Path, there: Sequence[AuditEntry]) -> bool:
    """Whether the study has gone through the state at ``out``."""
    if there:
        return there[-1].sha256 in [entry.sha256 for entry in study.store.audit()]
    mine, other = study.folder / PROTOCOL_FILE, out / PROTOCOL_FILE
    return other.is_file() and mine.is_file() and mine.read_bytes() == other.read_bytes()


def _check_sound(folder: Path, fresh: Path, out: Path) -> None:
    """Refuse to put a damaged copy in the place of an earlier one.

    Raises:
        StudyError: it is damaged.
    """
    with StudyStore.open(fresh / STUDY_FILE) as store:
        whole = store.connection.read("PRAGMA quick_check") == [("ok",)]
        if whole and broken_at(store.audit()) is None:
            return
    raise StudyError(
        f"The study in {folder} is damaged, so the earlier backup in {out} stays as it is; see "
        f"steerlab study verify {quote(str(folder))}, or give another folder to copy the damaged "
        "study to."
    )
