"""All that leaves a study in an export: everybody who stayed, counted or not, and all their records."""
# pyarrow.compute makes its functions when it is imported:
# pyright: reportAttributeAccessIssue=false

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import pyarrow as pa
import pyarrow.compute as pc

from steerlab.analysis.study_data.asked import (
    Answered,
    Asking,
    answers_everywhere,
    asked_places,
    teach_phases,
)
from steerlab.analysis.study_data.networks import frozen_embeddings
from steerlab.analysis.study_data.phase_times import TIMED, PhaseTimes, phase_times
from steerlab.analysis.study_data.study import (
    changed_files,
    counted_series,
    why_not_counted,
)
from steerlab.learning.series import LabelSeries
from steerlab.study.attention import AttentionCheck, attention_checks
from steerlab.study.contract import Phase, PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.practice_record import Practised, practised
from steerlab.study.progress import ParticipantProgress, everybody, finished_rollouts
from steerlab.study.protocol import Condition, StudyProtocol
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.store.people import Enrolment, read_enrolments
from steerlab.study.store.records import Attempt, AttemptStatus, Flag, SessionRecord
from steerlab.study.store.teaching import read_teaching_rounds, read_teaching_trials
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.questionnaire import Questionnaire


@dataclass(frozen=True, kw_only=True, slots=True)
class KnownEmbedding:
    """A person's w.

    Attributes:
        source: how it was found, in words.
        distance, outside: of a w found with the network frozen; see ``StoredEmbedding``.
    """

    w: tuple[float, ...]
    source: str
    distance: float | None = None
    outside: bool | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class WholePerson:
    """A participant, whether or not they count.

    Attributes:
        why_excluded: as ``analyze`` says it; None if they count.
        attempts: the one that counts of each calibration rollout that they finished.
        answers: of every place in which the study asks anything.
        times: of the phases on their way.
        attention: the checks that they were shown on pages that they handed in.
        practised: in all their practice phases; None before the end of one.
        sessions: at the wheel, in order.
    """

    enrolment: Enrolment
    standing: Standing
    why_excluded: str | None
    attempts: Mapping[str, Attempt]
    answers: Mapping[Asking, Answered]
    times: tuple[PhaseTimes, ...]
    attention: tuple[AttentionCheck, ...]
    practised: Practised | None
    sessions: tuple[SessionRecord, ...]
    embedding: KnownEmbedding | None

    @property
    def id(self) -> str:
        """The pseudonym."""
        return self.enrolment.participant

    @property
    def scripted(self) -> bool | None:
        """Whether a script steered; None before anybody did."""
        kinds = {session.input_kind for session in self.sessions}
        return "scripted" in kinds if kinds else None

    @property
    def latency_s(self) -> float | None:
        """Of the device of the attempts that count; None if it is unknown, or differs."""
        used = {attempt.session for attempt in self.attempts.values()}
        known = {one.input_latency_ms for one in self.sessions if one.id in used}
        latency_ms = known.pop() if len(known) == 1 else None
        return None if latency_ms is None else latency_ms / 1000.0


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeStudy:
    """Everything an export is made from, of everybody who did not leave.

    Attributes:
        id: the same in every copy of a study's folder, and in no other study.
        state: the audit's newest hash, which differs after every change; ``changed_utc`` is its time.
        asked: every place in which the study asks a questionnaire, in order.
        teach_phases: ids of the planned teaching phases; nearly always one.
        timed_phases: all phases, of either role, whose beginning is on record.
        flags: of each attempt that broke a limit of timing.
        labels: steps of finished attempts, ``LABELLED_STEP_SCHEMA``.
        timings: of the same steps, ``TIMING_SCHEMA``.
        rounds, trials: of teaching, those that count.
        notices: what the reader of an export should know, in sentences.
    """

    id: str
    title: str
    state: str
    changed_utc: str
    protocol_version: int
    protocol_sha256: str
    questionnaires: Mapping[str, Questionnaire]
    conditions: tuple[Condition, ...]
    rollouts: tuple[str, ...]
    asked: tuple[Asking, ...]
    teach_phases: tuple[str, ...]
    timed_phases: tuple[Phase, ...]
    people: tuple[WholePerson, ...]
    series: tuple[LabelSeries, ...]
    attempts: tuple[Attempt, ...]
    flags: Mapping[tuple[str, str, int], Sequence[Flag]]
    labels: pa.Table
    timings: pa.Table
    rounds: pa.Table
    trials: pa.Table
    notices: tuple[str, ...]

    def teach_phase(self, phase: str) -> str:
        """The planned phase that a condition's phase such as ``teach-2`` belongs to."""
        return phase.rpartition("-")[0]


def study_id(study: OpenStudy) -> str:
    """Identifies a study by its audit's first hash, which holds a time.

    It begins with a letter, so that no program takes it for a number.

    Raises:
        StudyError: nothing has happened in it yet.
    """
    first = study.store.connection.read("SELECT sha256 FROM audit ORDER BY id LIMIT 1")
    if not first:
        raise StudyError(f"Nobody is enrolled in {study.folder}, so there is nothing to export.")
    return f"s{first[0][0][:15]}"


def study_state(study: OpenStudy) -> tuple[str, str]:
    """The hash and the time of the audit's newest entry: the hash differs after every change."""
    query = "SELECT sha256, at_utc FROM audit ORDER BY id DESC LIMIT 1"
    return study.store.connection.read(query)[0]


def read_whole_study(study: OpenStudy, *, with_withdrawn: bool) -> WholeStudy:
    """Everything of everybody but those who left.

    Args:
        with_withdrawn: also of those who left and let their data be kept, whom ``analyze`` counts.

    Raises:
        SteerlabError: the study cannot be read, or holds nobody to export.
    """
    with study.reading():
        return _read(study, with_withdrawn)


def _read(study: OpenStudy, with_withdrawn: bool) -> WholeStudy:
    id_, versions = study_id(study), study.versions()
    state, changed_utc = study_state(study)
    protocols = [study.protocol_of(frozen.version) for frozen in versions]
    asked, notices = asked_places(protocols), changed_files(study)
    everyone = everybody(study)
    stayed = [one for one in everyone if _stays(one.view.standing, with_withdrawn)]
    notices += _who_left(everyone, with_withdrawn)
    if not stayed:
        raise StudyError(f"Nobody is left in {study.folder} whose data could be exported.")
    ids = pa.array([one.view.id for one in stayed], pa.string())
    store = study.store
    finished, sessions = store.attempts(AttemptStatus.FINISHED), store.sessions()
    counting = [(one, finished_rollouts(study, one, finished)) for one in stayed]
    people = _people(study, counting, asked, list(sessions.values()), notices)
    names = {person.id for person in people}
    attempts = tuple(one for one in store.attempts() if one.participant in names)
    current = protocols[-1]
    return WholeStudy(
        id=id_,
        title=current.title,
        state=state,
        changed_utc=changed_utc,
        protocol_version=versions[-1].version,
        protocol_sha256=versions[-1].sha256,
        questionnaires=study.questionnaires,
        conditions=tuple({one.key: one for p in protocols for one in p.conditions}.values()),
        rollouts=tuple(dict.fromkeys(name for p in protocols for name in p.rollouts)),
        asked=asked,
        teach_phases=tuple(dict.fromkeys(name for p in protocols for name in teach_phases(p))),
        timed_phases=_timed_phases(protocols),
        people=people,
        series=tuple(counted_series(study, counting)),
        attempts=attempts,
        flags={one.key: flags for one in attempts if (flags := store.flags(one))},
        labels=_of(store.read_labels([AttemptStatus.FINISHED]), ids),
        timings=_of(store.timings(), ids),
        rounds=_of(read_teaching_rounds(store.connection), ids),
        trials=_of(read_teaching_trials(store.connection), ids),
        notices=tuple(notices),
    )


def _stays(standing: Standing, with_withdrawn: bool) -> bool:
    return not standing.erased and (with_withdrawn or standing is not Standing.WITHDRAWN_KEPT)


def _who_left(everyone: Sequence[ParticipantProgress], with_withdrawn: bool) -> list[str]:
    kept = [one.view.id for one in everyone if one.view.standing is Standing.WITHDRAWN_KEPT]
    if not kept:
        return []
    if with_withdrawn:
        return [f"Withdrew, and left their data, which are here: {len(kept)}."]
    return [
        f"Withdrew, and left their data in the study: {len(kept)}. They are not here; analyze "
        "counts them if they had finished. --withdrawn exports them too."
    ]


def _of(table: pa.Table, people: pa.Array) -> pa.Table:
    return table.filter(pc.is_in(table["participant"], value_set=people))


def _people(
    study: OpenStudy,
    counting: Sequence[tuple[ParticipantProgress, dict[str, Attempt]]],
    asked: Sequence[Asking],
    sessions: Sequence[SessionRecord],
    notices: list[str],
) -> tuple[WholePerson, ...]:
    enrolments = {one.participant: one for one in read_enrolments(study.store.connection)}
    excluded = {one.view.id: why_not_counted(study, one, attempts) for one, attempts in counting}
    finished = [one for one, _ in counting if excluded[one.view.id] is None]
    embeddings = _embeddings(study, finished, notices)
    return tuple(
        WholePerson(
            enrolment=enrolments[one.view.id],
            standing=one.view.standing,
            why_excluded=excluded[one.view.id],
            attempts=attempts,
            answers=answers_everywhere(study, one, asked, notices),
            times=tuple(phase_times(one, phase, state) for phase, state in one.view.phases),
            attention=attention_checks(study, one),
            practised=_practised(one),
            sessions=tuple(known for known in sessions if known.participant == one.view.id),
            embedding=embeddings.get(one.view.id),
        )
        for one, attempts in counting
    )


def _practised(person: ParticipantProgress) -> Practised | None:
    done = [
        practised(person, phase.id)
        for phase, state in person.view.phases
        if phase.kind is PhaseKind.PRACTICE and state is PhaseState.DONE
    ]
    if not done:
        return None
    return Practised(
        balls=sum(one.balls for one in done),
        blocks_hit=sum(one.blocks_hit for one in done),
        driven_s=sum(one.driven_s for one in done),
    )


def _embeddings(
    study: OpenStudy, people: Sequence[ParticipantProgress], notices: list[str]
) -> dict[str, KnownEmbedding]:
    """The w of training people in the frozen network, and of test people as it was kept."""
    training = [one.view.id for one in people if one.view.role.value == "training"]
    frozen = frozen_embeddings(study, training, notices)
    rows = () if frozen is None else zip(frozen.people, frozen.w.tolist(), strict=True)
    found = {who: KnownEmbedding(w=tuple(w), source="trained with the network") for who, w in rows}
    for who, kept in read_embeddings(study.store.connection).items():
        if who in {one.view.id for one in people}:
            found[who] = KnownEmbedding(
                w=tuple(kept.w.tolist()),
                source="found with the network frozen",
                distance=kept.distance,
                outside=kept.outside,
            )
    return found


def _timed_phases(protocols: Sequence[StudyProtocol]) -> tuple[Phase, ...]:
    phases: dict[str, Phase] = {}
    for protocol, role in product(protocols, Role):
        order = tuple(condition.key for condition in protocol.conditions)
        for phase in protocol.phases_for(role, order):
            if phase.kind in TIMED:
                phases.setdefault(phase.id, phase)
    return tuple(phases.values())
