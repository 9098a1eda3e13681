"""A study's folder as ``StudyData``: who counts, which answers and attempts, and the frozen plan."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow as pa

from steerlab.analysis.study_data.conditions_file import METRICS
from steerlab.analysis.study_data.conduct import SCRIPTED, Counted, conduct_of
from steerlab.analysis.study_data.networks import study_networks
from steerlab.analysis.study_data.records import (
    ConditionValue,
    Exclusion,
    Person,
    Plan,
    PlannedHypothesis,
    StudyData,
)
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.progress import Progress
from steerlab.study.attention import EXCLUDED, attention_checks
from steerlab.study.contract import Phase, PhaseKind, PhaseState, Standing
from steerlab.study.derived import ErasureGuard
from steerlab.study.progress import (
    ParticipantProgress,
    answers_of,
    everybody,
    finished_rollouts,
)
from steerlab.study.protocol import AnalysisPlan
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.teaching import read_teaching_rounds
from steerlab.study.study_folder import FrozenPlan, OpenStudy
from steerlab.study.surveys.answer_format import InvalidAnswer, Value
from steerlab.study.surveys.questionnaire import Questionnaire
from steerlab.study.surveys.scoring import score


def read_study(folder: Path, *, networks: int, progress: Progress) -> StudyData:
    """A study; ``networks`` networks are trained without the held-out rollouts, 0 for none.

    They are kept in ``models/``, from where an erasure removes them with the others.

    Raises:
        SteerlabError: there is no study, or it cannot be read.
    """
    if networks < 0:
        raise InvalidConfig(f"seeds is {networks}; give 0 or more.")
    study = OpenStudy.open(folder, read_only=True)
    guard = ErasureGuard.of(folder)
    try:
        with study.reading():
            data = _read(study)
        notices = list(data.notices)
        embeddings, held_out = study_networks(
            study, data.people, data.series, networks, progress, notices, guard
        )
        return replace(
            data, embeddings=tuple(embeddings), held_out=tuple(held_out), notices=tuple(notices)
        )
    finally:
        study.store.close()


def _read(study: OpenStudy) -> StudyData:
    """All but what networks make of it."""
    finished = study.store.attempts(AttemptStatus.FINISHED)
    participants = everybody(study)
    exclusions: list[Exclusion] = []
    counted: list[tuple[ParticipantProgress, dict[str, Attempt]]] = []
    for participant in participants:
        attempts = finished_rollouts(study, participant, finished)
        why = why_not_counted(study, participant, attempts)
        if why is None:
            counted.append((participant, attempts))
        else:
            exclusions.append(Exclusion(what="person", who=participant.view.id, why=why))
    exclusions += _attempts_left_out(study, counted)
    notices = changed_files(study)
    people = tuple(
        _person(study, participant, attempts, notices) for participant, attempts in counted
    )
    series = tuple(counted_series(study, counted))
    scripted = frozenset(person.id for person in people if person.scripted)
    simulated = bool(people) and all(set(p.steered_with) == {SCRIPTED} for p in people)
    devices = sorted({kind for person in people for kind in person.steered_with})
    if len(devices) > 1:
        notices.append(
            f"Participants steered with different devices ({', '.join(devices)}), whose labels are "
            f"pooled here."
        )
    if scripted and not simulated:
        notices.append(
            f"{len(scripted)} of the {len(people)} participants are scripted, and every number here "
            f"has them in it: nothing here is a result about people. They are "
            f"{', '.join(sorted(scripted))}."
        )
    if simulated:
        notices.append(
            "All participants are scripted: labels and answers come from seeded models, and say "
            "nothing about people."
        )
    return StudyData(
        kind="study",
        title=study.current().title,
        simulated=simulated,
        people=people,
        series=series,
        questionnaires=_with_translations(study, participants, notices),
        flagged=_flagged(study, counted),
        conditions=(
            *_taught_rounds(study, people),
            *(
                value
                for participant, _ in counted
                for value in _scores_after_conditions(study, participant, notices)
            ),
        ),
        plan=_plan_of(study),
        exclusions=tuple(exclusions),
        enrolled=len(participants),
        conduct=conduct_of(study, counted, scripted),
        notices=tuple(notices),
    )


def _with_translations(
    study: OpenStudy, participants: Sequence[ParticipantProgress], notices: list[str]
) -> dict[str, Questionnaire]:
    """The questionnaires; one that was asked in an unvalidated translation is unvalidated too."""
    known = dict(study.questionnaires)
    phases = [phase for one in participants for phase, _ in _questionnaire_phases(one)]
    asked = {key for phase in phases for key in phase.questionnaires}
    translations = [known[key] for key in sorted(asked) if known[key].translates]
    for one in translations:
        if one.unvalidated:
            known[one.original] = replace(known[one.original], unvalidated=True)
    if translations:
        notices.append(
            f"Answers to a translation are reported as answers to what it translates: "
            f"{', '.join(one.key for one in translations)}."
        )
    return known


def changed_files(study: OpenStudy) -> list[str]:
    """A notice if a file differs from its frozen copy: answers are scored by the file as it is."""
    try:
        study.check_unchanged()
    except SteerlabError as error:
        return [str(error)]
    return []


def why_not_counted(
    study: OpenStudy, participant: ParticipantProgress, attempts: dict[str, Attempt]
) -> str | None:
    """Why a participant does not count; None if they do."""
    standing, rollouts = participant.view.standing, participant.rollouts
    if standing is Standing.WITHDRAWN_ERASED:
        return "withdrew, and their data are erased"
    if standing is Standing.DECLINED:
        return "did not consent"
    missing = [name for name in rollouts if name not in attempts]
    left = " (withdrew, data kept)" if standing is Standing.WITHDRAWN_KEPT else ""
    if missing:
        return f"no finished attempt at {len(missing)} of {len(rollouts)} rollouts{left}"
    taught = [state for phase, state in participant.view.phases if phase.kind is PhaseKind.TEACH]
    if not rollouts and PhaseState.DONE not in taught:
        return f"taught no robot to the end{left}"
    if EXCLUDED in study.current().plan.exclusions:
        checks = attention_checks(study, participant)
        if failed := sum(not check.passed for check in checks):
            return f"failed {failed} of {len(checks)} attention checks, which the plan excludes by"
    return None


def _attempts_left_out(study: OpenStudy, counted: Counted) -> list[Exclusion]:
    """Attempts that do not count, of participants who do."""
    counting = {participant.view.id: set(attempts.values()) for participant, attempts in counted}
    rollouts = {participant.view.id: participant.rollouts for participant, _ in counted}
    exclusions: list[Exclusion] = []
    for attempt in study.store.attempts():
        who = attempt.participant
        if who not in counting or attempt in counting[who] or attempt.rollout not in rollouts[who]:
            continue
        why = {
            AttemptStatus.ABANDONED: f"abandoned: {attempt.end_reason}",
            AttemptStatus.RUNNING: "cut off, or under way",
            AttemptStatus.FINISHED: "done again, the later attempt counts",
        }[attempt.status]
        exclusions.append(Exclusion(what="attempt", who=str(attempt), why=why))
    return exclusions


def _flagged(study: OpenStudy, counted: Counted) -> frozenset[tuple[str, str]]:
    return frozenset(
        (attempt.participant, attempt.rollout)
        for _, attempts in counted
        for attempt in attempts.values()
        if study.store.flags(attempt)
    )


def _person(
    study: OpenStudy,
    participant: ParticipantProgress,
    attempts: dict[str, Attempt],
    notices: list[str],
) -> Person:
    known = study.store.sessions()
    sessions = [known[a.session] for a in attempts.values() if a.session in known]
    latencies = {session.input_latency_ms for session in sessions}
    # One device, one latency: with several, none is right for all rollouts.
    latency_ms = latencies.pop() if len(latencies) == 1 else None
    parts = tuple(phase.rollouts for phase, _ in participant.view.phases if phase.rollouts)
    return Person(
        id=participant.view.id,
        role="training" if participant.view.role.value == "training" else "test",
        answers=_answers_about_themselves(study, participant, notices),
        order=participant.view.order,
        latency_s=None if latency_ms is None else latency_ms / 1000.0,
        steered_with=tuple(sorted({session.input_kind for session in sessions})),
        attention=attention_checks(study, participant),
        parts=parts if len(parts) > 1 else (),
    )


def counted_series(study: OpenStudy, counted: Counted) -> list[LabelSeries]:
    """Labels of the attempts that count, by participant and then rollout as in the protocol."""
    keys = {attempt.key for _, attempts in counted for attempt in attempts.values()}
    if not keys:
        return []
    table = study.store.read_labels()
    columns = [table.column(name).to_pylist() for name in ("participant", "rollout", "attempt")]
    keep = pa.array([key in keys for key in zip(*columns, strict=True)])
    position = {
        (participant.view.id, rollout): (row, column)
        for row, (participant, _) in enumerate(counted)
        for column, rollout in enumerate(participant.rollouts)
    }
    labels = series_from_table(table.filter(keep))
    return sorted(labels, key=lambda series: position[series.person, series.rollout])


def _answers_about_themselves(
    study: OpenStudy, participant: ParticipantProgress, notices: list[str]
) -> dict[str, dict[str, Value]]:
    """Answers by questionnaire and item, of all questionnaires that are not about a condition.

    Those to a translation are under the key of what it translates. A page that is not finished, or
    open again, has no answers yet: they may still be changed.

    Args:
        notices: answers that had to be left out are appended.
    """
    answers: dict[str, dict[str, Value]] = {}
    for phase, done in _questionnaire_phases(participant):
        if phase.condition is None:
            given = answers_of(study, participant, phase.id) if done else {}
            for key in phase.questionnaires:
                allowed = allowed_answers(study, participant, key, given.get(key, {}), notices)
                answers[study.questionnaires[key].original] = allowed
    return answers


def _scores_after_conditions(
    study: OpenStudy, participant: ParticipantProgress, notices: list[str]
) -> list[ConditionValue]:
    """Scores of the questionnaires that followed each condition."""
    values: list[ConditionValue] = []
    for phase, done in _questionnaire_phases(participant):
        if phase.condition is None or not done:
            continue
        given = answers_of(study, participant, phase.id)
        for key in phase.questionnaires:
            answers = allowed_answers(study, participant, key, given.get(key, {}), notices)
            values += [
                ConditionValue(
                    person=participant.view.id,
                    condition=phase.condition,
                    metric=f"{study.questionnaires[key].original}.{scale}",
                    value=scored.score,
                    position=participant.view.order.index(phase.condition),
                )
                for scale, scored in score(study.questionnaires[key], answers).items()
                if scored.score is not None
            ]
    return values


def _questionnaire_phases(participant: ParticipantProgress) -> Iterator[tuple[Phase, bool]]:
    """The participant's questionnaire phases, and whether each is finished."""
    for phase, state in participant.view.phases:
        if phase.kind is PhaseKind.QUESTIONNAIRES:
            yield phase, state is PhaseState.DONE


def allowed_answers(
    study: OpenStudy,
    participant: ParticipantProgress,
    key: str,
    given: Mapping[str, Value],
    notices: list[str],
) -> dict[str, Value]:
    """Answers that the questionnaire, as it is now, still allows."""
    kept: dict[str, Value] = {}
    for item, value in given.items():
        try:
            kept[item] = study.questionnaires[key].check(item, value)
        except InvalidAnswer as error:
            notices.append(f"An answer of {participant.view.id} to {key} was left out: {error}")
    return kept


def _taught_rounds(study: OpenStudy, people: Sequence[Person]) -> list[ConditionValue]:
    """Success, distance and label error of the rounds that count, of the people who count."""
    counted = {person.id for person in people}
    return [
        ConditionValue(
            person=row["participant"],
            condition=row["condition"],
            metric=metric,
            value=float(row[metric]),
            round=row["round"],
            position=row["position"] - 1 if row["position"] else None,
        )
        for row in read_teaching_rounds(study.store.connection).to_pylist()
        if row["participant"] in counted
        for metric in METRICS
        if row[metric] is not None
    ]


def _plan_of(study: OpenStudy) -> Plan:
    """The newest frozen plan, or the file's while nothing is frozen."""
    versions = study.versions()
    if not versions:
        return _plan(study.current().plan, None, ())
    plans = study.analysis_plans()
    by_version = {frozen.protocol_version: frozen for frozen in plans}
    amendments = tuple(
        _changed_plan(by_version[protocol.version])
        if protocol.version in by_version
        else f"Version {protocol.version} of the protocol, with the same plan, was recorded on "
        f"{protocol.frozen_utc}: {protocol.why}"
        for protocol in versions[1:]
    )
    return _plan(plans[-1].plan, plans[-1], amendments)


def _changed_plan(frozen: FrozenPlan) -> str:
    return (
        f"The analysis plan was changed with version {frozen.protocol_version} of the protocol on "
        f"{frozen.frozen_utc}, when {frozen.enrolled_before} participants were enrolled: "
        f"{frozen.why}"
    )


def _plan(plan: AnalysisPlan, frozen: FrozenPlan | None, amendments: tuple[str, ...]) -> Plan:
    return Plan(
        alpha=plan.alpha,
        correction=plan.correction,
        hypotheses=tuple(
            PlannedHypothesis(
                id=h.id, text=h.text, outcome=h.outcome, test=h.test, primary=h.primary
            )
            for h in plan.hypotheses
        ),
        exclusions=plan.exclusions,
        version=None if frozen is None else frozen.protocol_version,
        sha256=None if frozen is None else frozen.sha256,
        protocol_sha256=None if frozen is None else frozen.protocol_sha256,
        frozen_utc=None if frozen is None else frozen.frozen_utc,
        amendments=amendments,
    )
