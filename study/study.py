"""``Study``: all that the command line and the console do with a study."""

import secrets
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Self

from steerlab.sim.errors import unreadable
from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.sim.progress import Progress
from steerlab.study.completeness import session_findings
from steerlab.study.consent import NO_ENTRIES, ConsentEntries, ConsentRecord, ConsentText
from steerlab.study.contract import (
    ParticipantView,
    Role,
    StudyCheck,
    StudyError,
)
from steerlab.study.design import Design, design_of
from steerlab.study.enrolment import amend, enrol
from steerlab.study.item_orders import item_order
from steerlab.study.pages import consent, consent_record, consent_text, save_answer, submit
from steerlab.study.progress import ProgressCache, given_answers, progress_of
from steerlab.study.redo import flags_of_drives, redo
from steerlab.study.store.answers import insert_note, read_notes
from steerlab.study.store.forms import result_of, take
from steerlab.study.store.people import insert_link, read_link_owner
from steerlab.study.study_folder import FrozenPlan, OpenStudy
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import Questionnaire

if TYPE_CHECKING:
    from steerlab.study.erasing_reach import Reach
    from steerlab.study.runner import RunConfig, RunReport
    from steerlab.study.store.frozen import FrozenModel
    from steerlab.study.verify import Verified

LONGEST_NOTE = 10_000  # characters


class Study:
    """An open study, a ``StudyAccess``; it belongs to the thread that opened it.

    Whatever a method changed is on the disk when it returns.
    """

    def __init__(self, opened: OpenStudy) -> None:
        self._opened = opened
        self._progress = ProgressCache(opened)

    @classmethod
    def open(cls, folder: Path, *, read_only: bool = False) -> Self:
        """Open the study in ``folder``.

        Raises:
            SteerlabError: there is none, or part of it cannot be read.
        """
        return cls(OpenStudy.open(folder, read_only=read_only))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the database."""
        self._opened.store.close()

    @property
    def folder(self) -> Path:
        """The study's folder."""
        return self._opened.folder

    @property
    def title(self) -> str:
        """The study's title."""
        return self._opened.current().title

    @property
    def language(self) -> str:
        """Of the pages and windows, such as ``en``."""
        return self._opened.current().language

    def participants(self) -> Sequence[ParticipantView]:
        """All, withdrawn ones too, in the order in which they were enrolled."""
        return [progress.view for progress in self._progress.all()]

    def participant(self, participant: str) -> ParticipantView:
        """One of them.

        Raises:
            StudyError: there is none of that id.
        """
        return self._progress.of(participant).view

    def enrol(self, role: Role, *, form: str | None = None) -> ParticipantView:
        """Enrol the next participant; the first one freezes the protocol.

        Args:
            form: a key of what asks for it; the same key again returns the same participant.

        Raises:
            StudyError: the protocol is wrong, or was changed after it was frozen.
        """
        return self.participant(enrol(self._opened, role, form))

    def amend(self, why: str) -> int:
        """Record the changed protocol as a new version, and return its number.

        Raises:
            StudyError: nothing is frozen, nothing changed, or there is no reason.
        """
        return amend(self._opened, why)

    def design(self) -> Design:
        """How many were recruited, with which orders, and who dropped out."""
        return design_of(self.participants(), self._opened.current().design)

    def new_link(self, participant: str) -> str:
        """A fresh unguessable token for the participant's pages; only its hash is kept.

        Older tokens of the participant end.

        Raises:
            StudyError: there is no such participant, or they have withdrawn.
        """
        connection = self._opened.store.connection
        token = secrets.token_urlsafe(32)
        with connection.transaction(f"make a link for {participant!r}", durable=True):
            standing = progress_of(self._opened, participant).view.standing
            if standing.withdrawn:
                raise StudyError(f"{participant} has left ({standing}).")
            insert_link(connection, participant, _token_sha256(token))
        return token

    def participant_of(self, token: str) -> str | None:
        """The participant whose newest token this is; None if it is nobody's.

        Who has withdrawn may still open their page: it thanks them and says what became of their
        data. So the hash of their newest token stays, also when everything else is erased.
        """
        return read_link_owner(self._opened.store.connection, _token_sha256(token))

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
        """What was answered so far, by item; ``Questionnaire.counted`` says what counts of it."""
        progress = self._progress.of(participant)
        progress.phase(phase)
        return given_answers(self._opened, progress, phase).get(questionnaire, {})

    def item_order(self, participant: str, phase: str, questionnaire: str) -> Sequence[str]:
        """Ids of all items, in the order in which the participant sees them there."""
        progress = self._progress.of(participant)
        with self._opened.reading():
            return item_order(progress, phase, self.questionnaire(questionnaire))

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

    def consent_text(self, participant: str) -> ConsentText:
        """The newest text, or that which the participant has decided on."""
        self._progress.of(participant)
        return consent_text(self._opened, participant)

    def consent_record(self, participant: str) -> ConsentRecord | None:
        """The participant's decision; None before there is one, and when it is erased."""
        progress = self._progress.of(participant)
        with self._opened.reading():
            return consent_record(self._opened, progress)

    def consent(
        self,
        participant: str,
        *,
        given: bool,
        shown: int | None = None,
        entries: ConsentEntries = NO_ENTRIES,
    ) -> None:
        """Record the decision on the text of version ``shown``; None is the newest.

        Raises:
            StudyError: another version is valid by now, the opposite decision was made before, or
                a yes lacks something that the text asks for.
        """
        consent(self._opened, participant, given=given, shown=shown, entries=entries)

    def analysis_plans(self) -> Sequence[FrozenPlan]:
        """The plan frozen before the first participant, then each that replaced it.

        Raises:
            StudyError: nothing is frozen yet.
        """
        return self._opened.analysis_plans()

    def note(self, participant: str | None, text: str, *, form: str | None = None) -> None:
        """Keep a remark of the experimenter about a participant; None is about the study.

        Args:
            form: as of ``enrol``.

        Raises:
            StudyError: it is blank or too long, has characters that are none to read, or there is
                no such participant any more.
        """
        text = "\n".join(text.strip().splitlines())
        if found := unreadable(text):
            raise StudyError(f"The note has {found!r} in it, which nobody can read; leave it out.")
        if not 1 <= len(text) <= LONGEST_NOTE:
            raise StudyError(
                f"The note has {len(text)} characters; write between 1 and {LONGEST_NOTE}."
            )
        connection = self._opened.store.connection
        with connection.transaction("keep a note", durable=True):
            if participant and progress_of(self._opened, participant).view.standing.erased:
                raise StudyError(f"{participant} was erased; nothing about them is kept.")
            if result_of(connection, form) is None:
                insert_note(connection, participant, text)
                take(connection, form, "note kept")

    def notes(self, participant: str | None) -> Sequence[tuple[str, str]]:
        """Time in UTC and text of each remark."""
        return read_notes(self._opened.store.connection, participant)

    def redo(
        self,
        participant: str,
        phase: str,
        *,
        rollouts: Sequence[str] = (),
        form: str | None = None,
    ) -> None:
        """Open a finished phase again; what was recorded stays and no longer counts.

        Calibrating again opens the computation of w again as well.

        Args:
            rollouts: only these of a calibration phase, which keeps the others; none stands for
                all.
            form: as of ``enrol``.

        Raises:
            StudyError: the phase is not over, is consent, has no such rollout, or the frozen
                network has learnt from it; or the participant has left.
        """
        redo(self._opened, participant, phase, rollouts=rollouts, form=form)

    def drives(self, participant: str, phase: str) -> Mapping[str, str]:
        """What was flagged, in words, of each finished rollout of a calibration phase."""
        with self._opened.reading():
            return flags_of_drives(self._opened, self._progress.of(participant), phase)

    def erasing_reaches(self, participant: str) -> "Reach":
        """What else erasing a participant's data touches."""
        from steerlab.study.erasing_reach import erasing_reaches

        return erasing_reaches(self._opened, participant)

    def withdraw(
        self,
        participant: str,
        *,
        erase: bool,
        progress: Progress = lambda what, share: None,
    ) -> None:
        """Let a participant leave; erasing takes everything but a tombstone with it.

        Raises:
            SteerlabError: a run is under way, or another program reads the database.
        """
        from steerlab.study.withdrawal import withdraw

        withdraw(self._opened, participant, erase=erase, progress=progress)

    def findings(self, participant: str | None) -> Sequence[StudyCheck]:
        """Of a participant's pages and last session; with None, ``verify``'s findings."""
        if participant is not None:
            with self._opened.reading():
                return session_findings(self._opened, self._progress.of(participant))
        return self.verify().findings

    def verify(self, *, expected_head: str | None = None) -> "Verified":
        """Check everything; changes nothing."""
        from steerlab.study.verify import verify

        return verify(self._opened, expected_head=expected_head)

    def run(self, participant: str, config: "RunConfig") -> "RunReport":
        """Do what is next for a participant at the wheel.

        Raises:
            SteerlabError: they are not at that phase, another run is under way, or a device fails.
        """
        from steerlab.study.runner import run

        return run(self._opened, participant, config)

    def run_new(self, role: Role, config: "RunConfig") -> tuple[str, "RunReport"]:
        """Enrol a participant and do their phases; nobody is enrolled for a run that is refused.

        Returns:
            their pseudonym, and what was done.

        Raises:
            SteerlabError: as of ``enrol`` and ``run``.
        """
        from steerlab.study.runner import run_new

        return run_new(self._opened, role, config)

    def train(self, progress: Progress) -> "FrozenModel":
        """Train the network and freeze it.

        Raises:
            StudyError: it is frozen already, or too few training participants have finished.
        """
        from steerlab.study.models import train

        self._opened.check_unchanged()
        with locked(self.folder, RUN_LOCK, "works in"):
            return train(self._opened, progress)

    def change_count(self) -> int:
        """A number that grows with every change."""
        query = "SELECT coalesce(max(id), 0) FROM audit"
        return self._opened.store.connection.read(query)[0][0]


def _token_sha256(token: str) -> str:
    return sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
