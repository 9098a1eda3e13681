"""A study's folder as ``StudyData``: who counts, which answers and attempts, and the frozen plan."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from steerlab.analysis.study_data.networks import Progress
from steerlab.analysis.study_data.records import (
    Exclusion,
    Person,
    Role,
    StudyData,
)
from steerlab.analysis.study_data.study_answers import (
    answers_about_themselves,
    scores_after_conditions,
)
from steerlab.analysis.study_data.study_conditions import taught_rounds
from steerlab.analysis.study_data.study_networks import study_networks
from steerlab.analysis.study_data.study_plan import plan_of
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.study.contract import Standing
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import (
    ParticipantProgress as Place,
)
from steerlab.study.progress import (
    everybody,
    finished_rollouts,
)
from steerlab.study.store.records import Attempt, AttemptStatus


def read_study(folder: Path, *, networks: int, progress: Progress) -> StudyData:
    """A study; ``networks`` networks are trained without the held-out rollouts, 0 for none.

    They are kept in ``models/``, from where an erasure removes them with the others.

    Raises:
        SteerlabError: there is no study, or it cannot be read.
    """
    if networks < 0:
        raise InvalidConfig(f"seeds is {networks}; give 0 or more.")
    study = OpenStudy.open(folder, read_only=True)
    try:
        return _read(study, networks, progress)
    finally:
        study.store.close()


def _read(study: OpenStudy, networks: int, progress: Progress) -> StudyData:
    finished = study.store.attempts(AttemptStatus.FINISHED)
    places = everybody(study)
    exclusions: list[Exclusion] = []
    counted: list[tuple[Place, dict[str, Attempt]]] = []
    for place in places:
        attempts = finished_rollouts(study, place, finished)
        why = _why_not(place, attempts)
        if why is None:
            counted.append((place, attempts))
        else:
            exclusions.append(Exclusion(what="person", who=place.view.id, why=why))
    exclusions += _attempts_left_out(study, counted)
    notices = _changed(study)
    people = tuple(_person(study, place, attempts, notices) for place, attempts in counted)
    series = tuple(_series(study, counted))
    embeddings, held_out = study_networks(study, people, series, networks, progress, notices)
    simulated = bool(people) and all(set(one.steered_with) == {"scripted"} for one in people)
    devices = sorted({kind for one in people for kind in one.steered_with})
    if len(devices) > 1:
        notices.append(
            f"Participants steered with different devices ({', '.join(devices)}), whose labels are "
            f"pooled here."
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
        questionnaires=study.questionnaires,
        flagged=_flagged(study, counted),
        embeddings=tuple(embeddings),
        held_out=tuple(held_out),
        conditions=(
            *taught_rounds(study, people),
            *(
                one
                for place, _ in counted
                for one in scores_after_conditions(study, place, notices)
            ),
        ),
        plan=plan_of(study),
        exclusions=tuple(exclusions),
        enrolled=len(places),
        notices=tuple(notices),
    )


def _changed(study: OpenStudy) -> list[str]:
    """What differs from what was frozen: the plan is the frozen one, answers are scored as it is now."""
    try:
        study.check_unchanged()
    except SteerlabError as error:
        return [str(error)]
    return []


def _why_not(place: Place, attempts: dict[str, Attempt]) -> str | None:
    """Why a participant does not count; None if they do."""
    standing = place.view.standing
    if standing is Standing.WITHDRAWN_ERASED:
        return "withdrew, and their data are erased"
    if standing is Standing.DECLINED:
        return "did not consent"
    missing = [name for name in place.protocol.rollouts if name not in attempts]
    left = " (withdrew, data kept)" if standing is Standing.WITHDRAWN_KEPT else ""
    if missing:
        return f"no finished attempt at {len(missing)} of {len(place.protocol.rollouts)} rollouts{left}"
    return None


def _attempts_left_out(
    study: OpenStudy, counted: Sequence[tuple[Place, dict[str, Attempt]]]
) -> list[Exclusion]:
    """Attempts of those who count that do not count themselves."""
    mine = {place.view.id: set(attempts.values()) for place, attempts in counted}
    rollouts = {place.view.id: place.protocol.rollouts for place, _ in counted}
    found: list[Exclusion] = []
    for attempt in study.store.attempts():
        who = attempt.participant
        if who not in mine or attempt in mine[who] or attempt.rollout not in rollouts[who]:
            continue
        why = {
            AttemptStatus.ABANDONED: f"abandoned: {attempt.end_reason}",
            AttemptStatus.RUNNING: "cut off, or under way",
            AttemptStatus.FINISHED: "done again, the later attempt counts",
        }[attempt.status]
        found.append(Exclusion(what="attempt", who=str(attempt), why=why))
    return found


def _flagged(
    study: OpenStudy, counted: Sequence[tuple[Place, dict[str, Attempt]]]
) -> frozenset[tuple[str, str]]:
    return frozenset(
        (attempt.participant, attempt.rollout)
        for _, attempts in counted
        for attempt in attempts.values()
        if study.store.flags(attempt)
    )


def _person(
    study: OpenStudy, place: Place, attempts: dict[str, Attempt], notices: list[str]
) -> Person:
    known = study.store.sessions()
    sessions = [known[a.session] for a in attempts.values() if a.session in known]
    latencies = {one.input_latency_ms for one in sessions}
    # One device, one latency: with several, none is right for all rollouts.
    latency_ms = latencies.pop() if len(latencies) == 1 else None
    return Person(
        id=place.view.id,
        role=_role(place),
        answers=answers_about_themselves(study, place, notices),
        order=place.view.order,
        latency_s=None if latency_ms is None else latency_ms / 1000.0,
        steered_with=tuple(sorted({one.input_kind for one in sessions})),
    )


def _series(
    study: OpenStudy, counted: Sequence[tuple[Place, dict[str, Attempt]]]
) -> list[LabelSeries]:
    keys = {attempt.key for _, attempts in counted for attempt in attempts.values()}
    if not keys:
        return []
    table = study.store.read_labels()
    columns = [table.column(name).to_pylist() for name in ("participant", "rollout", "attempt")]
    keep = pa.array([key in keys for key in zip(*columns, strict=True)])
    found = series_from_table(table.filter(keep))
    places = {place.view.id: row for row, (place, _) in enumerate(counted)}
    order = {place.view.id: place.protocol.rollouts for place, _ in counted}
    return sorted(found, key=lambda one: (places[one.person], order[one.person].index(one.rollout)))


def _role(place: Place) -> Role:
    return "training" if place.view.role.value == "training" else "test"
