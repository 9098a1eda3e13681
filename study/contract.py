"""What the console and the verbs know of a study; ``teleop.study.study.Study`` is one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from steerlab.sim.errors import SteerlabError
from steerlab.study.surveys.questionnaire import Questionnaire

Value = str | int | float
"""An answer: a number on a scale, a chosen option or a text."""


class StudyError(SteerlabError):
    """A study cannot be used as asked: says what is wrong and how to mend it."""


class Role(StrEnum):
    """Training participants teach the mapper; test participants are taught with it."""

    TRAINING = "training"
    TEST = "test"


class PhaseKind(StrEnum):
    """What a phase consists of; those with pages are done in the browser, the rest at the wheel."""

    CONSENT = "consent"  # page
    QUESTIONNAIRES = "questionnaires"  # page
    INSTRUCTIONS = "instructions"  # page
    PRACTICE = "practice"  # wheel
    CALIBRATION = "calibration"  # wheel
    CALIBRATE_W = "calibrate_w"  # computer
    TEACH = "teach"  # wheel; one phase for each condition, in the assigned order
    DEBRIEF = "debrief"  # page


@dataclass(frozen=True, kw_only=True, slots=True)
class Phase:
    """One step of a participant's way through the study.

    Attributes:
        id: unique within the participant's way, such as ``pre`` or ``teach-2``.
        title: for people.
        condition: the learner's key, of teaching phases and of questionnaires about one.
        questionnaires: keys, in order.
        text: of consent, instructions and debriefing pages; paragraphs.
    """

    id: str
    kind: PhaseKind
    title: str
    condition: str | None = None
    questionnaires: tuple[str, ...] = ()
    text: tuple[str, ...] = ()


class PhaseState(StrEnum):
    """How far a phase got."""

    WAITING = "waiting"
    STARTED = "started"
    DONE = "done"
    SKIPPED = "skipped"  # on record with its reason, such as a learner that this version lacks


class Standing(StrEnum):
    """Where a participant stands."""

    ENROLLED = "enrolled"
    RUNNING = "running"
    FINISHED = "finished"
    DECLINED = "declined"  # said no to the consent form
    WITHDRAWN_KEPT = "withdrawn, data kept"
    ERASING = "withdrawn, being erased"  # until the erasure is said again, if it was cut off
    WITHDRAWN_ERASED = "withdrawn, data erased"

    @property
    def withdrawn(self) -> bool:
        """They left, whatever became of their data."""
        return self in (Standing.WITHDRAWN_KEPT, Standing.ERASING, Standing.WITHDRAWN_ERASED)


@dataclass(frozen=True, kw_only=True, slots=True)
class ParticipantView:
    """A participant as the console shows them.

    Attributes:
        order: condition keys in the assigned order; empty for training participants.
        phases: the whole way, with how far each phase got.
        progress: of the phase that is under way, such as ``7 of 12 rollouts``; empty if none.
    """

    id: str
    role: Role
    standing: Standing
    order: tuple[str, ...]
    phases: tuple[tuple[Phase, PhaseState], ...]
    progress: str = ""
    protocol_version: int = 1

    @property
    def next_phase(self) -> Phase | None:
        """The first that is to be done; None when all are, or the participant has left."""
        if self.standing not in (Standing.ENROLLED, Standing.RUNNING):
            return None
        over = (PhaseState.DONE, PhaseState.SKIPPED)
        return next((phase for phase, state in self.phases if state not in over), None)


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyCheck:
    """One line of a check.

    Attributes:
        ok: nothing is wrong.
        mend: what to do; empty where there is nothing to do.
        notice: nothing is wrong, and yet it should be known: who has not finished yet.
    """

    what: str
    found: str
    ok: bool
    mend: str = ""
    notice: bool = False


class StudyAccess(Protocol):
    """Reads and changes a study; every change is durable when its method returns."""

    @property
    def title(self) -> str:
        """The study's title."""
        ...

    def participants(self) -> Sequence[ParticipantView]:
        """All, withdrawn ones too, in the order in which they were enrolled."""
        ...

    def participant(self, participant: str) -> ParticipantView:
        """One of them.

        Raises:
            StudyError: there is none of that id.
        """
        ...

    def enrol(self, role: Role) -> ParticipantView:
        """Enrol the next participant; id and condition order are the program's choice.

        The first enrolment freezes the protocol.
        """
        ...

    def new_link(self, participant: str) -> str:
        """A fresh unguessable token for the participant's pages; older ones end.

        Only its hash is kept.
        """
        ...

    def participant_of(self, token: str) -> str | None:
        """Whose token it is, also after they have left; None if nobody's, or if it has ended."""
        ...

    def questionnaire(self, key: str) -> Questionnaire:
        """One of the protocol's questionnaires."""
        ...

    def answers(self, participant: str, phase: str, questionnaire: str) -> Mapping[str, Value]:
        """What was answered so far, by item."""
        ...

    def save_answer(
        self, participant: str, phase: str, questionnaire: str, item: str, value: Value | None
    ) -> None:
        """Keep one answer (None takes it back); an earlier one stays in the audit.

        Raises:
            StudyError: the phase is not the participant's, is done already, or has no such item.
            InvalidAnswer: the value is out of range.
        """
        ...

    def submit(self, participant: str, phase: str) -> Mapping[str, Sequence[str]]:
        """Finish a page phase. Doing it twice changes nothing.

        Returns:
            items that must still be answered, by questionnaire; empty when it is done.

        Raises:
            StudyError: the phase is not the participant's next one, nor done already.
        """
        ...

    def consent_text(self, participant: str) -> tuple[int, Sequence[str]]:
        """Version and paragraphs: the newest, or those that the participant has decided on."""
        ...

    def consent(self, participant: str, *, given: bool, shown: int | None = None) -> None:
        """Record the decision, with version and hash of the text.

        A yes finishes the consent phase; a no ends the participant's way.

        Args:
            shown: version of the text that the decision was made on; None for the newest.

        Raises:
            StudyError: another text than the one shown is valid by now, or the other decision was
                made before.
        """
        ...

    def note(self, participant: str | None, text: str) -> None:
        """Keep a remark of the experimenter's."""
        ...

    def notes(self, participant: str | None) -> Sequence[tuple[str, str]]:
        """(time in UTC, text) of each remark."""
        ...

    def redo(self, participant: str, phase: str) -> None:
        """Open a finished phase again; what was recorded stays and no longer counts."""
        ...

    def withdraw(self, participant: str, *, erase: bool) -> None:
        """Let a participant leave; erasing takes everything but a tombstone with it."""
        ...

    def findings(self, participant: str | None) -> Sequence[StudyCheck]:
        """How it stands with the device and the timing of a participant's last session.

        With None: with the whole study, its integrity and its completeness.
        """
        ...

    def change_count(self) -> int:
        """Grows with every change by whichever process; the console's pages follow it."""
        ...
