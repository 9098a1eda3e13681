"""Leaving a study: an explicit act that keeps the data, or erases all but a tombstone."""

import re
from pathlib import Path

from steerlab.sim.files.folder_lock import CONSOLE_LOCK, RUN_LOCK, LockedOut, holder_name, locked
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.shared_folder import everything_in, remove
from steerlab.sim.progress import Progress
from steerlab.study.contract import StudyError
from steerlab.study.derived import DERIVED, DERIVED_LOCK, derived_files, derived_lock, left_of
from steerlab.study.models import remove_models_of, renew
from steerlab.study.progress import progress_of
from steerlab.study.protocol_file import PROTOCOL_FILE, QUESTIONNAIRES
from steerlab.study.recording.session_recorder import RECORDINGS
from steerlab.study.store.people import (
    Departure,
    erase_rows,
    read_departures,
    scrub,
    write_departure,
)
from steerlab.study.store.store import DATABASE_FILES
from steerlab.study.study_folder import MODELS, OpenStudy

_KEPT = (
    *(PROTOCOL_FILE, QUESTIONNAIRES, RECORDINGS, MODELS),
    *(RUN_LOCK, CONSOLE_LOCK, DERIVED_LOCK),
    *(holder_name(RUN_LOCK), holder_name(CONSOLE_LOCK), holder_name(DERIVED_LOCK)),
)
"""What is no derived data, or is looked through for the person's own part of it."""
_KNOWN = (*DATABASE_FILES, *DERIVED, *_KEPT)


def withdraw(study: OpenStudy, participant: str, *, erase: bool, progress: Progress) -> None:
    """Let a participant leave. If a crash cuts it off, calling it again finishes it.

    Erasing removes rows, recordings, models, and all exports and reports, rewrites the database
    without them, trains the network anew without the person if enough people are left, and leaves
    pseudonym, condition order, the hash of their link, and the acts in the audit, which hold no
    answer and no label.

    Raises:
        StudyError: nobody is enrolled under that name, their data are erased already, or a file
            cannot be deleted; call it again after that.
        LockedOut: a run is under way in this study; one of another participant keeps nobody whose
            data are kept from leaving.
        StoreError: another program reads the database, so that traces remain; call it again.
    """
    progress_of(study, participant)
    connection = study.store.connection
    if not erase:
        try:
            with locked(study.folder, RUN_LOCK, "works in"):
                _keep(study, participant)
        except LockedOut as busy:
            if busy.about in ("", participant):
                raise
            _keep(study, participant)  # somebody else is at the wheel, whom this does not touch
        return
    with locked(study.folder, RUN_LOCK, "works in"):
        left = read_departures(connection).get(participant)
        if left is Departure.ERASED:
            with derived_lock(study.folder):  # what came back since, from a backup for example
                back = {*traces(study.folder, participant), *left_of(study.folder, participant)}
                for path in sorted(back):
                    if path.exists():
                        _delete(path)
            return
        if left is not Departure.ERASING:
            erase_rows(connection, participant)
        with derived_lock(study.folder):  # what others put in place until now is seen here
            for path in (
                *traces(study.folder, participant),
                *derived_files(study.folder, _KEPT),
            ):
                _delete(path)
            remove_models_of(study, participant)
            for path in left_of(study.folder, participant):  # under other names in what is kept
                _delete(path)
        scrub(connection)
        renew(study, progress)
        with connection.transaction(f"finish erasing {participant!r}", durable=True):
            write_departure(connection, participant, Departure.ERASED)


def _keep(study: OpenStudy, participant: str) -> None:
    connection = study.store.connection
    with connection.transaction(f"withdraw {participant!r}", durable=True):
        left = read_departures(connection).get(participant)
        if left is None:
            write_departure(connection, participant, Departure.KEPT)
        elif left is not Departure.KEPT:
            raise StudyError(f"The data of {participant} are erased; they cannot be kept.")


def traces(folder: Path, participant: str) -> list[Path]:
    """Files and folders under ``recordings`` and ``models`` that carry the participant's pseudonym.

    Such as ``recordings/P001-calibration-05-0.rrd``, whole or in parts, and networks with their w.
    Empty once they are erased.
    """
    named = re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")
    paths: list[Path] = []
    for subfolder in (RECORDINGS, MODELS):
        for path in everything_in(folder / subfolder):  # a folder before what is in it
            if named.search(path.name) and not set(path.parents) & set(paths):
                paths.append(path)
    return paths


def unknown_files(folder: Path) -> list[Path]:
    """Files and folders that steerlab did not put into the study's folder, and never touches."""
    return [path for path in sorted(folder.iterdir()) if path.name not in _KNOWN]


def _delete(path: Path) -> None:
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
        remove(path)
    except OSError as error:
        raise StudyError(
            f"Cannot delete {path}: {refusal(error, 'put that right')}. Then withdraw the participant "
            f"again."
        ) from error
