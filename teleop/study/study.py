"""``Study``: the one door to a study, for the command line and the console."""

import secrets
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from steerlab.analysis.surveys.questionnaire import Questionnaire
from steerlab.sim.store_answers import Value, insert_note, read_notes
from steerlab.sim.store_people import insert_link, read_link_owner
from steerlab.teleop.folder_lock import RUN_LOCK, locked
from steerlab.teleop.study.completeness import session_findings
from steerlab.teleop.study.contract import (
    Finding,
    ParticipantView,
    Role,
    Standing,
    StudyError,
)
from steerlab.teleop.study.enrolment import amend, enrol
from steerlab.teleop.study.opened import OpenStudy
from steerlab.teleop.study.pages import consent, save_answer, submit
from steerlab.teleop.study.progress import answers_of, everybody, progress_of
from steerlab.teleop.study.redo import redo

if TYPE_CHECKING:
    from steerlab.sim.store_frozen import FrozenModel
    from steerlab.teleop.study.runner import RunConfig, RunReport
    from steerlab.teleop.study.verify import Verified

LONGEST_NOTE = 10_000


class Study:
    """An open study, a ``StudyAccess``; it belongs to the thread that opened it.

    Everything is on the disk when a method that changes something returns.
    """

    def __init__(self, opened: OpenStudy) -> None:
        self._opened = opened

    @classmethod
    def open(cls, folder: Path, *, read_only: bool = False) -> Self:
        """Open the study in ``folder``.

        Raises:
            SteerlabError: there is none, or its database or a questionnaire cannot be read.
        """
        return cls(OpenStudy.open(folder, read_only=read_only))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the database."""
        self._opened.store.close()

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self._opened.folder

    @property
    def title(self) -> str:
        """The study's title."""
        return self._opened.current().title

    def participants(self) -> Sequence[ParticipantView]:
        """All, withdrawn ones too, in the order in which they were enrolled."""
        return [place.view for place in everybody(self._opened)]

    def participant(self, participant: str) -> ParticipantView:
        """One of them.

        Raises:
            StudyError: there is none of that id.
        """
        return progress_of(self._opened, participant).view

    def enrol(self, role: Role) -> ParticipantView:
        """Enrol the next participant; the first one freezes the protocol.

        Raises:
            StudyError: the protocol is wrong, or was changed after it was frozen.
        """
        return self.participant(enrol(self._opened, role))

    def amend(self, why: str) -> int:
        """Record the changed protocol as a new version, and return its number.

        Raises:
            StudyError: nothing is frozen, nothing changed, or there is no reason.
        """
        return amend(self._opened, why)

    def new_link(self, participant: str) -> str:
        """A fresh unguessable token; older ones of the participant end. Only its hash is kept.

        Raises:
            StudyError: there is no such participant, or they have withdrawn.
        """
        standing = self.participant(participant).standing
        if standing in _WITHDRAWN:
            raise StudyError(f"{participant} has left ({standing}).")
        token = secrets.token_urlsafe(32)
        connection = self._opened.store.connection
        with connection.transaction(f"make a link for {participant!r}", durable=True):
            insert_link(connection, participant, sha256(token.encode()).hexdigest())
        return token

    def participant_of(self, token: str) -> str | None:
        """Whose token it is; None if nobody's, if it has ended, or if they have withdrawn."""
        hashed = sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
        owner = read_link_owner(self._opened.store.connection, hashed)
        if owner is None or self.participant(owner).standing in _WITHDRAWN:
            return None
        return owner

    def questionnaire(self, key: str) -> Questionnaire:
        """One of the study's questionnaires.

        Raises:
            StudyError: there is none of that key.
        """
        if key not in self._opened.questionnaires:
            known = ", ".join(sorted(self._opened.questionnaires))
            raise StudyError(f"There is no questionnaire {key!r}; there are {known}.")
        return self._opened.questionnaires[key]

    def answers(self, participant: str, phase: str, questionnaire: str) -> Mapping[str, Value]:
        """What was answered so far, by item."""
        place = progress_of(self._opened, participant)
        place.phase(phase)
        return answers_of(self._opened, place, phase).get(questionnaire, {})

    def save_answer(
        self, participant: str, phase: str, questionnaire: str, item: str, value: Value | None
    ) -> None:
        """Keep one answer; None takes it back.

        Raises:
            StudyError: the participant is not at that phase, or it has no such item.
            InvalidAnswer: the value is out of range.
        """
        save_answer(self._opened, participant, phase, questionnaire, item, value)

    def submit(self, participant: str, phase: str) -> Mapping[str, Sequence[str]]:
        """Finish a page; twice changes nothing. Returns what must still be answered.

        Raises:
            StudyError: the phase is not the participant's next one, nor finished.
        """
        return submit(self._opened, participant, phase)

    def consent(self, participant: str, *, given: bool) -> None:
        """Record the decision, with version and hash of the text that was shown.

        Raises:
            StudyError: the other decision was made before.
        """
        consent(self._opened, participant, given=given)

    def consent_text(self) -> tuple[int, Sequence[str]]:
        """Version and paragraphs, as the newest protocol has them."""
        text = self._opened.current().consent
        return text.version, text.text

    def note(self, participant: str | None, text: str) -> None:
        """Keep a remark of the experimenter's; None is about the study.

        Raises:
            StudyError: it is blank or too long, or there is no such participant any more.
        """
        text = text.strip()
        if not 1 <= len(text) <= LONGEST_NOTE:
            raise StudyError(
                f"The note has {len(text)} characters; write between 1 and {LONGEST_NOTE}."
            )
        if participant and self.participant(participant).standing is Standing.WITHDRAWN_ERASED:
            raise StudyError(f"{participant} was erased; nothing about them is kept.")
        connection = self._opened.store.connection
        with connection.transaction("keep a note", durable=True):
            insert_note(connection, participant, text)

    def notes(self, participant: str | None) -> Sequence[tuple[str, str]]:
        """(time in UTC, text) of each remark."""
        return read_notes(self._opened.store.connection, participant)

    def redo(self, participant: str, phase: str) -> None:
        """Open a finished phase again; what was recorded stays and no longer counts.

        Raises:
            StudyError: it is not over, or must stay as it is.
        """
        redo(self._opened, participant, phase)

    def withdraw(
        self,
        participant: str,
        *,
        erase: bool,
        progress: Callable[[str, float], None] = lambda what, share: None,
    ) -> None:
        """Let a participant leave; erasing takes everything but a tombstone with it.

        Raises:
            SteerlabError: a run is under way, or another program reads the database.
        """
        from steerlab.teleop.study.withdrawal import withdraw

        withdraw(self._opened, participant, erase=erase, progress=progress)

    def findings(self, participant: str | None) -> Sequence[Finding]:
        """Device and timing of a participant's last session; with None, ``verify``'s findings."""
        if participant is None:
            return self.verify().findings
        return session_findings(self._opened, progress_of(self._opened, participant))

    def verify(self, *, expected_head: str | None = None) -> "Verified":
        """Check everything; changes nothing."""
        from steerlab.teleop.study.verify import verify

        return verify(self._opened, expected_head=expected_head)

    def run(self, participant: str, config: "RunConfig") -> "RunReport":
        """Do what is next for a participant at the wheel.

        Raises:
            SteerlabError: they are elsewhere, another run is under way, or a device fails.
        """
        from steerlab.teleop.study.runner import run

        return run(self._opened, participant, config)

    def train(self, progress: Callable[[str, float], None]) -> "FrozenModel":
        """Train the network and freeze it.

        Raises:
            StudyError: it is frozen already, or too few training participants have finished.
        """
        from steerlab.teleop.study.models import train

        self._opened.check_unchanged()
        with locked(self.folder, RUN_LOCK, "works in"):
            return train(self._opened, progress)

    def change_count(self) -> int:
        """Grows with every change: each one has its entry in the audit."""
        query = "SELECT coalesce(max(id), 0) FROM audit"
        return self._opened.store.connection.read(query)[0][0]


_WITHDRAWN = (Standing.WITHDRAWN_KEPT, Standing.WITHDRAWN_ERASED)
