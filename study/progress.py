"""Where a participant stands, worked out from what is on record: so a crash loses no place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from steerlab.study.contract import (
    ParticipantView,
    Phase,
    PhaseKind,
    PhaseState,
    Role,
    Standing,
    StudyError,
)
from steerlab.study.opened import OpenStudy
from steerlab.study.phases import phases_for
from steerlab.study.protocol import StudyProtocol
from steerlab.study.store.answers import Response, Value, read_responses
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

_STATES = {
    PhaseAct.STARTED: PhaseState.STARTED,
    PhaseAct.DONE: PhaseState.DONE,
    PhaseAct.SKIPPED: PhaseState.SKIPPED,
    PhaseAct.REOPENED: PhaseState.WAITING,
}


@dataclass(frozen=True, kw_only=True)
class ParticipantProgress:
    """A participant's place, and what belongs to it.

    Attributes:
        acts: on each phase, in order.
    """

    view: ParticipantView
    protocol: StudyProtocol
    acts: Mapping[str, tuple[PhaseEvent, ...]]

    def state(self, phase: str) -> PhaseState:
        """How far a phase of theirs got."""
        return next(state for one, state in self.view.phases if one.id == phase)

    def phase(self, phase: str) -> Phase:
        """The phase of that id.

        Raises:
            StudyError: it is none of theirs.
        """
        found = next((one for one, _ in self.view.phases if one.id == phase), None)
        if found is None:
            known = ", ".join(one.id for one, _ in self.view.phases)
            raise StudyError(f"{self.view.id} has no phase {phase!r}; they have {known}.")
        return found

    def of_kind(self, kind: PhaseKind) -> Phase | None:
        """The first phase of that kind."""
        return next((one for one, _ in self.view.phases if one.kind is kind), None)

    def phase_run(self, phase: str) -> int:
        """How often a phase was reopened."""
        return sum(act.act is PhaseAct.REOPENED for act in self.acts.get(phase, ()))

    def first_attempt(self, phase: str) -> int:
        """Attempts at rollouts count from this one on."""
        reopened = [a for a in self.acts.get(phase, ()) if a.act is PhaseAct.REOPENED]
        return reopened[-1].first_attempt if reopened else 0


def progress_of(study: OpenStudy, participant: str) -> ParticipantProgress:
    """A participant's place.

    Raises:
        StudyError: nobody is enrolled under that name.
    """
    enrolled = read_enrolments(study.store.connection)
    for enrolment in enrolled:
        if enrolment.participant == participant:
            return _progress(_Records(study, participant), enrolment)
    known = ", ".join(one.participant for one in enrolled) or "nobody"
    raise StudyError(f"{participant!r} is not enrolled; enrolled are: {known}.")


def everybody(study: OpenStudy) -> list[ParticipantProgress]:
    """Everyone's place, in the order in which they were enrolled."""
    records = _Records(study)
    return [_progress(records, one) for one in read_enrolments(study.store.connection)]


def finished_rollouts(
    study: OpenStudy, place: ParticipantProgress, attempts: Sequence[Attempt] | None = None
) -> dict[str, Attempt]:
    """The attempt that counts at each calibration rollout that the participant finished.

    Args:
        attempts: everybody's finished ones, where many participants are asked about.
    """
    phase = place.of_kind(PhaseKind.CALIBRATION)
    if phase is None:
        return {}
    first = place.first_attempt(phase.id)
    if attempts is None:
        attempts = study.store.attempts(AttemptStatus.FINISHED)
    return {
        attempt.rollout: attempt  # the last one stays
        for attempt in attempts
        if attempt.participant == place.view.id
        and attempt.order_index >= first
        and attempt.rollout in place.protocol.rollouts
    }


def answers_of(
    study: OpenStudy, place: ParticipantProgress, phase: str
) -> dict[str, dict[str, Value]]:
    """What counts of the answers in a phase, by questionnaire and item."""
    found: dict[str, dict[str, Response]] = {}
    for one in read_responses(study.store.connection, place.view.id, phase):
        if one.phase_run == place.phase_run(phase):
            found.setdefault(one.questionnaire, {})[one.item] = one
    return {
        key: {item: one.value for item, one in items.items() if one.value is not None}
        for key, items in found.items()
    }


@dataclass(frozen=True)
class _Records:
    """What is on record of one participant or of all, each table read once and when needed."""

    study: OpenStudy
    participant: str | None = None

    @cached_property
    def acts(self) -> Mapping[str, Sequence[PhaseEvent]]:
        found: dict[str, list[PhaseEvent]] = {}
        for act in read_phase_events(self.study.store.connection, self.participant):
            found.setdefault(act.participant, []).append(act)
        return found

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
        for phase in phases_for(protocol, role, enrolment.condition_order)
    )
    place = ParticipantProgress(
        view=ParticipantView(
            id=participant,
            role=role,
            standing=_standing(records, participant, [state for _, state in phases]),
            order=enrolment.condition_order,
            phases=phases,
            protocol_version=enrolment.protocol_version,
        ),
        protocol=protocol,
        acts={phase: tuple(them) for phase, them in acts.items()},
    )
    return replace(place, view=replace(place.view, progress=_words(records, place)))


_LEFT = {
    Departure.KEPT: Standing.WITHDRAWN_KEPT,
    Departure.ERASING: Standing.ERASING,
    Departure.ERASED: Standing.WITHDRAWN_ERASED,
}


def _standing(records: _Records, participant: str, states: list[PhaseState]) -> Standing:
    left = records.departures.get(participant)
    if left is not None:
        return _LEFT[left]
    if records.consents.get(participant) is False:
        return Standing.DECLINED
    if all(state in (PhaseState.DONE, PhaseState.SKIPPED) for state in states):
        return Standing.FINISHED
    if all(state is PhaseState.WAITING for state in states):
        return Standing.ENROLLED
    return Standing.RUNNING


def _words(records: _Records, place: ParticipantProgress) -> str:
    """How far the phase got that is under way."""
    study, phase = records.study, place.view.next_phase
    if phase is None or place.state(phase.id) is not PhaseState.STARTED:
        return ""
    if phase.kind is PhaseKind.CALIBRATION:
        finished = finished_rollouts(study, place, records.finished)
        return f"{len(finished)} of {len(place.protocol.rollouts)} rollouts"
    if phase.kind is PhaseKind.QUESTIONNAIRES:
        asked = sum(len(study.questionnaires[key].items) for key in phase.questionnaires)
        given = sum(map(len, answers_of(study, place, phase.id).values()))
        return f"{given} of {asked} answers"
    if phase.kind is PhaseKind.TEACH:
        taught = read_taught(study.store.connection, place.view.id, phase.id)
        return f"{len(taught)} of {place.protocol.demonstrations + 1} drives"
    return ""
