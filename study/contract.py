"""The types of a study, and ``StudyAccess``: what the console needs of it; ``study.Study`` is one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

from steerlab.sim.errors import SteerlabError
from steerlab.study.consent import NO_ENTRIES, ConsentEntries, ConsentRecord, ConsentText
from steerlab.study.surveys.answer_format import Value
from steerlab.study.surveys.questionnaire import Questionnaire

if TYPE_CHECKING:
    from steerlab.study.design import Design
    from steerlab.study.erasing_reach import Reach


class StudyError(SteerlabError):
    """A study cannot be used as asked; the message says why and what to do."""


class Role(StrEnum):
    """The network is trained on training participants; test participants teach robots with it."""

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


PAGES = (
    PhaseKind.CONSENT,
    PhaseKind.QUESTIONNAIRES,
    PhaseKind.INSTRUCTIONS,
    PhaseKind.DEBRIEF,
)
"""Kinds that are done in the browser."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Phase:
    """One step of a participant through the study.

    Attributes:
        id: unique among the participant's phases, such as ``pre`` or ``teach-2``.
        title: as people read it.
        condition: the learner's key, of teaching phases and of questionnaires about one.
        questionnaires: keys, in order.
        text: of consent, instructions and debriefing pages; paragraphs.
        rollouts: names of those that are corrected in a calibration phase, in order.
    """

    id: str
    kind: PhaseKind
    title: str
    condition: str | None = None
    questionnaires: tuple[str, ...] = ()
    text: tuple[str, ...] = ()
    rollouts: tuple[str, ...] = ()


class PhaseState(StrEnum):
    """How far a phase got."""

    WAITING = "waiting"
    STARTED = "started"
    DONE = "done"
    SKIPPED = "skipped"  # on record with its reason, such as a learner that this version lacks

    @property
    def over(self) -> bool:
        """Nothing is left to do in the phase."""
        return self in (PhaseState.DONE, PhaseState.SKIPPED)


class Standing(StrEnum):
    """Whether a participant has begun, finished or left."""

    ENROLLED = "enrolled"
    RUNNING = "running"
    FINISHED = "finished"
    DECLINED = "declined"  # said no to the consent form
    WITHDRAWN_KEPT = "withdrawn, data kept"
    ERASING = "withdrawn, being erased"  # if it was cut off: until it is asked for again
    WITHDRAWN_ERASED = "withdrawn, data erased"

    @property
    def withdrawn(self) -> bool:
        """The participant left, whether or not their data were kept."""
        return self is Standing.WITHDRAWN_KEPT or self.erased

    @property
    def erased(self) -> bool:
        """The participant left, and their data are gone, or being erased."""
        return self in (Standing.ERASING, Standing.WITHDRAWN_ERASED)


@dataclass(frozen=True, kw_only=True, slots=True)
class ParticipantView:
    """A participant as the console shows them.

    Attributes:
        order: condition keys in the assigned order; empty for training participants.
        phases: all of them in order, with how far each got.
        progress: of the phase that is under way, such as ``7 of 12 rollouts``; empty if none is.
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
        return next((phase for phase, state in self.phases if not state.over), None)


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyCheck:
    """The result of one check.

    Attributes:
        what: was checked.
        found: the result, in words.
        ok: nothing is wrong.
        mend: what to do; empty where there is nothing to do.
        notice: nothing is wrong, but it should be known, such as who has not finished yet.
    """

    what: str
    found: str
    ok: bool
    mend: str = ""
    notice: bool = False


class StudyAccess(Protocol):
    """Reads and changes a study; every change is durable when its method returns.

    What takes a ``form``, a key of what asks for it, is done once for each key; None is no key.
    """

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

    def enrol(self, role: Role, *, form: str | None = None) -> ParticipantView:
        """Enrol the next participant; id and condition order are the program's choice.

        The first enrolment freezes the protocol. A key again gives the same participant.
        """
        ...

    def new_link(self, participant: str) -> str:
        """A fresh unguessable token for the participant's pages; older ones end.

        Only its hash is kept.
        """
        ...

    def participant_of(self, token: str) -> str | None:
        """The participant with that token, also after they left; None if it is unknown or ended."""
        ...

    def questionnaire(self, key: str) -> Questionnaire:
        """One of the protocol's questionnaires."""
        ...

    def answers(self, participant: str, phase: str, questionnaire: str) -> Mapping[str, Value]:
        """What was answered so far, by item; see ``Questionnaire.counted`` for what counts of it."""
        ...

    def item_order(self, participant: str, phase: str, questionnaire: str) -> Sequence[str]:
        """Ids of all items, in the order in which the participant sees them there."""
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

    def consent_text(self, participant: str) -> ConsentText:
        """The newest text, or that which the participant has decided on."""
        ...

    def consent_record(self, participant: str) -> ConsentRecord | None:
        """The participant's decision; None before there is one, and when it is erased."""
        ...

    def consent(
        self,
        participant: str,
        *,
        given: bool,
        shown: int | None = None,
        entries: ConsentEntries = NO_ENTRIES,
    ) -> None:
        """Record the decision, with version and hash of the text.

        A yes finishes the consent phase; after a no the participant does nothing more. Whoever
        says to be too young has said no.

        Args:
            shown: version of the text that the decision was made on; None for the newest.
            entries: what was entered beside it; a yes needs all that the text asks for.

        Raises:
            StudyError: another text than the one shown is valid by now, the opposite decision
                was made before, or a yes lacks something.
        """
        ...

    def note(self, participant: str | None, text: str, *, form: str | None = None) -> None:
        """Keep a remark of the experimenter about a participant; None is about the study."""
        ...

    def notes(self, participant: str | None) -> Sequence[tuple[str, str]]:
        """Time in UTC and text of each remark."""
        ...

    def redo(
        self,
        participant: str,
        phase: str,
        *,
        rollouts: Sequence[str] = (),
        form: str | None = None,
    ) -> None:
        """Open a finished phase again; what was recorded stays and no longer counts.

        Args:
            rollouts: only these of a calibration phase, which keeps the others; none stands for
                all.
        """
        ...

    def drives(self, participant: str, phase: str) -> Mapping[str, str]:
        """What was flagged, in words, of each finished rollout of a calibration phase."""
        ...

    def erasing_reaches(self, participant: str) -> "Reach":
        """What else erasing a participant's data touches."""
        ...

    def withdraw(self, participant: str, *, erase: bool) -> None:
        """Let a participant leave; erasing takes everything but a tombstone with it."""
        ...

    def findings(self, participant: str | None) -> Sequence[StudyCheck]:
        """Checks of a participant's pages, and of device and timing of their sessions.

        With None: of the whole study, its integrity and its completeness.
        """
        ...

    def design(self) -> "Design":
        """How many were recruited, with which orders, and who dropped out."""
        ...

    def change_count(self) -> int:
        """A number that grows with every change by any process; the console polls it."""
        ...
