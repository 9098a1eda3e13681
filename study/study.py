"""``Study``: the one door to a study, for the command line and the console."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.study.completeness import session_findings
from steerlab.study.contract import ParticipantView, Role, StudyCheck, StudyError
from steerlab.study.enrolment import amend, enrol
from steerlab.study.links import new_link, participant_of
from steerlab.study.notes import keep_note
from steerlab.study.opened import OpenStudy
from steerlab.study.pages import consent, consent_text, save_answer, submit
from steerlab.study.progress import answers_of
from steerlab.study.progress_cache import ProgressCache
from steerlab.study.redo import redo
from steerlab.study.store.answers import Value, read_notes
from steerlab.study.surveys.questionnaire import Questionnaire

if TYPE_CHECKING:
    from steerlab.study.analysis_plan import FrozenPlan
    from steerlab.study.runner import RunConfig, RunReport
    from steerlab.study.store.frozen import FrozenModel
    from steerlab.study.verify import Verified


class Study:
    """An open study, a ``StudyAccess``; it belongs to the thread that opened it.

    Whatever a method changed is on the disk when it returns.
    """

    def __init__(self, opened: OpenStudy) -> None:
        self._opened = opened
        self._places = ProgressCache(opened)

    @classmethod
    def open(cls, folder: Path, *, read_only: bool = False) -> Self:
        """Open the study in ``folder``.

        Raises:
            SteerlabError: there is none, or part of it cannot be read.
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
        return [place.view for place in self._places.all()]

    def participant(self, participant: str) -> ParticipantView:
        """One of them.

        Raises:
            StudyError: there is none of that id.
        """
        return self._places.of(participant).view

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
        return new_link(self._opened, participant)

    def participant_of(self, token: str) -> str | None:
        """Whose token it is, also after they have left; None if nobody's, or if it has ended."""
        return participant_of(self._opened, token)

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
        place = self._places.of(participant)
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

    def consent_text(self, participant: str) -> tuple[int, Sequence[str]]:
        """Version and paragraphs: the newest, or those that the participant has decided on."""
        self._places.of(participant)
        text = consent_text(self._opened, participant)
        return text.version, text.text

    def consent(self, participant: str, *, given: bool, shown: int | None = None) -> None:
        """Record the decision on the text of version ``shown``; None is the newest.

        Raises:
            StudyError: another version is valid by now, or the other decision was made before.
        """
        consent(self._opened, participant, given=given, shown=shown)

    def analysis_plans(self) -> "Sequence[FrozenPlan]":
        """The plan frozen before the first participant, then each that replaced it.

        Raises:
            StudyError: nothing is frozen yet.
        """
        from steerlab.study.analysis_plan import frozen_plans

        return frozen_plans(self._opened)

    def note(self, participant: str | None, text: str) -> None:
        """Keep a remark of the experimenter's; None is about the study.

        Raises:
            StudyError: it is blank or too long, or there is no such participant any more.
        """
        keep_note(self._opened, participant, text)

    def notes(self, participant: str | None) -> Sequence[tuple[str, str]]:
        """Time in UTC and text of each remark."""
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
        from steerlab.study.withdrawal import withdraw

        withdraw(self._opened, participant, erase=erase, progress=progress)

    def findings(self, participant: str | None) -> Sequence[StudyCheck]:
        """Device and timing of a participant's last session; with None, ``verify``'s findings."""
        if participant is not None:
            return session_findings(self._opened, self._places.of(participant))
        return self.verify().findings

    def verify(self, *, expected_head: str | None = None) -> "Verified":
        """Check everything; changes nothing."""
        from steerlab.study.verify import verify

        return verify(self._opened, expected_head=expected_head)

    def run(self, participant: str, config: "RunConfig") -> "RunReport":
        """Do what is next for a participant at the wheel.

        Raises:
            SteerlabError: they are elsewhere, another run is under way, or a device fails.
        """
        from steerlab.study.runner import run

        return run(self._opened, participant, config)

    def train(self, progress: Callable[[str, float], None]) -> "FrozenModel":
        """Train the network and freeze it.

        Raises:
            StudyError: it is frozen already, or too few training participants have finished.
        """
        from steerlab.study.models import train

        self._opened.check_unchanged()
        with locked(self.folder, RUN_LOCK, "works in"):
            return train(self._opened, progress)

    def change_count(self) -> int:
        """Grows with every change."""
        query = "SELECT coalesce(max(id), 0) FROM audit"
        return self._opened.store.connection.read(query)[0][0]
