"""Remarks of the experimenter's, about a participant or about the study."""

from steerlab.study.contract import Standing, StudyError
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import progress_of
from steerlab.study.store.answers import insert_note

LONGEST_NOTE = 10_000  # characters
_GONE = (Standing.ERASING, Standing.WITHDRAWN_ERASED)


def keep_note(study: OpenStudy, participant: str | None, text: str) -> None:
    """Keep a remark; None is about the study.

    Raises:
        StudyError: it is blank or too long, or there is no such participant any more.
    """
    text = text.strip()
    if not 1 <= len(text) <= LONGEST_NOTE:
        raise StudyError(
            f"The note has {len(text)} characters; write between 1 and {LONGEST_NOTE}."
        )
    if participant and progress_of(study, participant).view.standing in _GONE:
        raise StudyError(f"{participant} was erased; nothing about them is kept.")
    with study.store.connection.transaction("keep a note", durable=True):
        insert_note(study.store.connection, participant, text)
