"""A participant's phases and standing, derived from the records, so that a crash loses nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from steerlab.sim.language import said
from steerlab.study.contract import (
    ParticipantView,
    Phase,
    PhaseKind,
    PhaseState,
    Role,
    Standing,
    StudyError,
)
from steerlab.study.protocol import StudyProtocol
from steerlab.study.store.answers import Response, read_responses
from steerlab.study.store.people import (
    Departure,
    Enrolment,
    PhaseAct,
    PhaseEvent,
    read_consents,
    read_departures,
    read_enrolments,
    read_phase_events,
)
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.teaching import read_taught
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import Value

_STATES = {
    PhaseAct.STARTED: PhaseState.STARTED,
    PhaseAct.DONE: PhaseState.DONE,
    PhaseAct.SKIPPED: PhaseState.SKIPPED,
    PhaseAct.REOPENED: PhaseState.WAITING,
}
_ROLLOUTS = "rollouts: "
_LEFT = {
    Departure.KEPT: Standing.WITHDRAWN_KEPT,
    Departure.ERASING: Standing.ERASING,
    Departure.ERASED: Standing.WITHDRAWN_ERASED,
}


@dataclass(frozen=True, kw_only=True)
class ParticipantProgress:
    """How far a participant got, under which version of the protocol.

    Attributes:
        acts: on each phase, in order.
    """

    view: ParticipantView
    protocol: StudyProtocol
    acts: Mapping[str, tuple[PhaseEvent, ...]]

    def state(self, phase: str) -> PhaseState:
        """How far the phase of that id got."""
        return next(state for known, state in self.view.phases if known.id == phase)

    def phase(self, phase: str) -> Phase:
        """The phase of that id.

        Raises:
            StudyError: the participant has no such phase.
        """
        phases = {known.id: known for known, _ in self.view.phases}
        if phase not in phases:
            raise StudyError(
                f"{self.view.id} has no phase {phase!r}; they have {', '.join(phases)}."
            )
        return phases[phase]

    @property
    def rollouts(self) -> tuple[str, ...]:
        """Names of all that the participant is to correct, in order."""
        return tuple(name for phase, _ in self.view.phases for name in phase.rollouts)

    def of_kind(self, kind: PhaseKind) -> Phase | None:
        """The first phase of that kind."""
        return next((phase for phase, _ in self.view.phases if phase.kind is kind), None)

    def phase_run(self, phase: str) -> int:
        """How often a phase was reopened."""
        return sum(act.act is PhaseAct.REOPENED for act in self.acts.get(phase, ()))

    def first_attempt(self, phase: str, rollout: str) -> int:
        """The ``order_index`` from which on attempts count, since the rollout was last reopened."""
        reopened = [
            act
            for act in self.acts.get(phase, ())
            if act.act is PhaseAct.REOPENED and rollout in (reopened_rollouts(act) or (rollout,))
        ]
        return reopened[-1].first_attempt if reopened else 0


def reopened_detail(rollouts: Sequence[str]) -> str:
    """The detail of an act that reopens these rollouts of a phase; empty for the whole phase."""
    return f"{_ROLLOUTS}{', '.join(rollouts)}" if rollouts else ""


def reopened_rollouts(act: PhaseEvent) -> tuple[str, ...]:
    """Names of the rollouts that were reopened; none if the whole phase was."""
    if not act.detail.startswith(_ROLLOUTS):
        return ()
    return tuple(act.detail.removeprefix(_ROLLOUTS).split(", "))


def progress_of(study: OpenStudy, participant: str) -> ParticipantProgress:
    """How far one participant got.

    Raises:
        StudyError: nobody is enrolled under that name.
    """
    with study.reading():
        enrolled = read_enrolments(study.store.connection)
        for enrolment in enrolled:
            if enrolment.participant == participant:
                return _progress(_Records(study, participant), enrolment)
    known = ", ".join(enrolment.participant for enrolment in enrolled) or "nobody"
    raise StudyError(f"{participant!r} is not enrolled; enrolled are: {known}.")


def everybody(study: OpenStudy) -> list[ParticipantProgress]:
    """How far each participant got, in the order in which they were enrolled."""
    records, connection = _Records(study), study.store.connection
    with study.reading():
        return [_progress(records, enrolment) for enrolment in read_enrolments(connection)]


class ProgressCache:
    """Keeps what ``progress_of`` and ``everybody`` return until the audit has a new entry.

    Every change that progress depends on has its entry in the audit, by whichever program, and an
    entry's hash seals all before it: the newest entry identifies the state of the whole study.
    Edits outside steerlab go unseen here; ``verify``, which looks for those, uses no cache.
    """

    def __init__(self, study: OpenStudy) -> None:
        self._study = study
        self._newest_entry: list[tuple[int, str | None]] = []
        self._kept: dict[str, ParticipantProgress] = {}
        self._all: list[ParticipantProgress] | None = None

    def of(self, participant: str) -> ParticipantProgress:
        """How far one participant got.

        Raises:
            StudyError: nobody is enrolled under that name.
        """
        self._drop_if_changed()
        if participant not in self._kept:
            self._kept[participant] = progress_of(self._study, participant)
        return self._kept[participant]

    def all(self) -> list[ParticipantProgress]:
        """How far each participant got, in the order in which they were enrolled."""
        self._drop_if_changed()
        if self._all is None:
            self._all = everybody(self._study)
            self._kept = {progress.view.id: progress for progress in self._all}
        return self._all

    def _drop_if_changed(self) -> None:
        query = "SELECT id, sha256 FROM audit ORDER BY id DESC LIMIT 1"
        newest = self._study.store.connection.read(query)
        if newest != self._newest_entry:
            self._newest_entry, self._kept, self._all = newest, {}, None


def finished_rollouts(
    study: OpenStudy, progress: ParticipantProgress, attempts: Sequence[Attempt] | None = None
) -> dict[str, Attempt]:
    """The attempt that counts at each calibration rollout that the participant finished.

    Args:
        attempts: everybody's finished attempts; None reads them, which is slow for many people.
    """
    first = {
        name: progress.first_attempt(phase.id, name)
        for phase, _ in progress.view.phases
        for name in phase.rollouts
    }
    if not first:
        return {}
    if attempts is None:
        attempts = study.store.attempts(AttemptStatus.FINISHED)
    return {
        attempt.rollout: attempt  # the last one stays
        for attempt in attempts
        if attempt.participant == progress.view.id
        and attempt.rollout in first
        and attempt.order_index >= first[attempt.rollout]
    }


def answers_of(
    study: OpenStudy, progress: ParticipantProgress, phase: str
) -> dict[str, dict[str, Value]]:
    """The answers of a phase that count, by questionnaire and item.

    An answer to an item that later answers have hidden does not count; it is kept all the same.
    """
    known = study.questionnaires
    return {
        key: known[key].counted(given) if key in known else given
        for key, given in given_answers(study, progress, phase).items()
    }


def given_answers(
    study: OpenStudy, progress: ParticipantProgress, phase: str
) -> dict[str, dict[str, Value]]:
    """The newest answers of a phase, by questionnaire and item, also to what is hidden by now."""
    newest: dict[str, dict[str, Response]] = {}
    for response in read_responses(study.store.connection, progress.view.id, phase):
        if response.phase_run == progress.phase_run(phase):
            newest.setdefault(response.questionnaire, {})[response.item] = response
    return {
        key: {item: given.value for item, given in items.items() if given.value is not None}
        for key, items in newest.items()
    }


@dataclass(frozen=True)
class _Records:
    """The records of one participant or of all, each table read once and only when needed."""

    study: OpenStudy
    participant: str | None = None

    @cached_property
    def acts(self) -> Mapping[str, Sequence[PhaseEvent]]:
        acts: dict[str, list[PhaseEvent]] = {}
        for act in read_phase_events(self.study.store.connection, self.participant):
            acts.setdefault(act.participant, []).append(act)
        return acts

    @cached_property
    def departures(self) -> Mapping[str, Departure]:
        return read_departures(self.study.store.connection)

    @cached_property
    def consents(self) -> Mapping[str, bool]:
        return read_consents(self.study.store.connection)

    @cached_property
    def finished(self) -> Sequence[Attempt]:
        return self.study.store.attempts(AttemptStatus.FINISHED)


def _progress(records: _Records, enrolment: Enrolment) -> ParticipantProgress:
    protocol = records.study.protocol_of(enrolment.protocol_version)
    role, participant = Role(enrolment.role), enrolment.participant
    acts: dict[str, list[PhaseEvent]] = {}
    for act in records.acts.get(participant, ()):
        acts.setdefault(act.phase, []).append(act)
    phases = tuple(
        (phase, _STATES[acts[phase.id][-1].act] if phase.id in acts else PhaseState.WAITING)
        for phase in protocol.phases_for(role, enrolment.condition_order, enrolment.place or 0)
    )
    progress = ParticipantProgress(
        view=ParticipantView(
            id=participant,
            role=role,
            standing=_standing(records, participant, [state for _, state in phases]),
            order=enrolment.condition_order,
            phases=phases,
            protocol_version=enrolment.protocol_version,
        ),
        protocol=protocol,
        acts={phase: tuple(of_phase) for phase, of_phase in acts.items()},
    )
    return replace(progress, view=replace(progress.view, progress=_in_words(records, progress)))


def _standing(records: _Records, participant: str, states: list[PhaseState]) -> Standing:
    left = records.departures.get(participant)
    if left is not None:
        return _LEFT[left]
    if records.consents.get(participant) is False:
        return Standing.DECLINED
    if all(state.over for state in states):
        return Standing.FINISHED
    if all(state is PhaseState.WAITING for state in states):
        return Standing.ENROLLED
    return Standing.RUNNING


def _in_words(records: _Records, progress: ParticipantProgress) -> str:
    """How far the phase got that is under way."""
    study, phase = records.study, progress.view.next_phase
    if phase is None or progress.state(phase.id) is not PhaseState.STARTED:
        return ""
    if phase.kind is PhaseKind.CALIBRATION:
        finished = finished_rollouts(study, progress, records.finished)
        done = sum(name in finished for name in phase.rollouts)
        return said("{done} of {count} rollouts").format(done=done, count=len(phase.rollouts))
    if phase.kind is PhaseKind.QUESTIONNAIRES:
        given = answers_of(study, progress, phase.id)
        asked = [
            study.questionnaires[key].shown(given.get(key, {})) for key in phase.questionnaires
        ]
        done, count = (sum(map(len, each)) for each in (given.values(), asked))
        return said("{done} of {count} answers").format(done=done, count=count)
    if phase.kind is PhaseKind.TEACH:
        taught = read_taught(study.store.connection, progress.view.id, phase.id)
        count = progress.protocol.demonstrations + 1
        return said("{done} of {count} drives").format(done=len(taught), count=count)
    return ""
