"""Leaving a study: an explicit act that keeps the data, or erases all but a tombstone."""

from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.study.contract import StudyError
from steerlab.study.models import ProgressBar, remove_models_of, renew
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import progress_of
from steerlab.study.store.erasure import erase_rows, scrub
from steerlab.study.store.people import Departure, read_departures, write_departure
from steerlab.study.traces import delete, derived, traces


def withdraw(study: OpenStudy, participant: str, *, erase: bool, progress: ProgressBar) -> None:
    """Let a participant leave. What a crash cut off is finished by saying it again.

    Erasing removes rows, recordings, models, and all exports and reports, rewrites the database
    without them, trains the network anew without the person if enough people are left, and leaves
    pseudonym, condition order, the hash of their link, and the acts in the audit, which hold no
    answer and no label.

    Raises:
        StudyError: nobody is enrolled under that name, their data are erased already, or a file
            cannot be deleted; say it again.
        LockedOut: a run is under way in this study.
        StoreError: another program reads the database, so that traces remain; say it again.
    """
    progress_of(study, participant)
    connection = study.store.connection
    with locked(study.folder, RUN_LOCK, "works in"):
        left = read_departures(connection).get(participant)
        if not erase:
            if left is None:
                with connection.transaction(f"withdraw {participant!r}", durable=True):
                    write_departure(connection, participant, Departure.KEPT)
            elif left is not Departure.KEPT:
                raise StudyError(f"The data of {participant} are erased; they cannot be kept.")
            return
        if left is Departure.ERASED:
            return
        if left is not Departure.ERASING:
            erase_rows(connection, participant)
        for path in (*traces(study.folder, participant), *derived(study.folder)):
            delete(path)
        remove_models_of(study, participant)
        scrub(connection)
        renew(study, progress)
        with connection.transaction(f"finish erasing {participant!r}", durable=True):
            write_departure(connection, participant, Departure.ERASED)
