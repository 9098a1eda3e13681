"""The table of participants: one row each, and everything that is known of them."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from steerlab.analysis.export.asked import asked_columns
from steerlab.analysis.export.tables import PARTICIPANTS, Column, ExportTable, made_table
from steerlab.analysis.export.variables import (
    Variable,
    choice,
    column_name,
    number,
    text,
    time,
    truth,
    whole,
)
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.study_data.whole_study import WholePerson, WholeStudy
from steerlab.analysis.style.person_style import PersonStyle, people_styles
from steerlab.learning.series import LabelSeries, by_person
from steerlab.sim.rollout import Outcome
from steerlab.study.contract import Standing
from steerlab.study.store.records import AttemptStatus

ROLES = {"training": "training participant", "test": "test participant"}


def participants_table(study: WholeStudy, *, free_text: bool) -> ExportTable:
    """One row a participant."""
    columns = [
        *_who(study),
        *_attention(study),
        *_practice(study),
        *_attempts(study),
        *_label_quality(study),
        *_style(study),
        *_embedding(study),
        *asked_columns(study, free_text=free_text),
        *_conditions(study),
        *_durations(study),
    ]
    return made_table(
        PARTICIPANTS,
        "a participant; who withdrew is not here",
        ("participant",),
        columns,
        study=study.id,
        rows=len(study.people),
    )


def _who(study: WholeStudy) -> Iterator[Column]:
    people = study.people
    yield _of(people, text("participant", "Pseudonym"), lambda one: one.id)
    yield _of(people, choice("role", "Role", ROLES), lambda one: one.enrolment.role)
    yield _of(
        people,
        truth("scripted", "A script took part, not a person", "script", "person"),
        lambda one: one.scripted,
    )
    standings = {standing.value: standing.value for standing in Standing if not standing.erased}
    yield _of(
        people, choice("standing", "How far they got", standings), lambda one: one.standing.value
    )
    yield _of(
        people,
        truth("counted", "Counts in the analysis, as steerlab analyze has it"),
        lambda one: one.why_excluded is None,
    )
    yield _of(
        people,
        text("exclusion", "Why they do not count; empty for those who do"),
        lambda one: one.why_excluded,
    )
    yield _of(
        people,
        whole("protocol_version", "Version of the protocol they were enrolled under"),
        lambda one: one.enrolment.protocol_version,
    )
    yield _of(people, time("enrolled_utc", "When enrolled"), lambda one: one.enrolment.at_utc)
    yield _of(
        people,
        text("condition_order", "Conditions in the order in which they were to be taught"),
        lambda one: " > ".join(one.enrolment.condition_order) or None,
    )
    yield _of(
        people,
        text("steered_with", "Kinds of device, if they have been at the wheel"),
        lambda one: " + ".join(sorted({s.input_kind for s in one.sessions})) or None,
    )
    yield _of(
        people,
        number("input_latency_s", "Measured latency of the device", "s", low=0.0),
        lambda one: one.latency_s,
    )


def _of(people: Sequence[WholePerson], variable: Variable, value: Any) -> Column:
    return Column(variable=variable, values=[value(person) for person in people])


def _attention(study: WholeStudy) -> Iterator[Column]:
    """Nothing where nobody was shown a check."""
    if not any(one.attention for one in study.people):
        return
    yield _of(
        study.people,
        whole("attention_checks", "Attention checks on pages that were handed in"),
        lambda one: len(one.attention),
    )
    yield _of(
        study.people,
        whole("attention_failed", "Attention checks that were not answered rightly"),
        lambda one: sum(not check.passed for check in one.attention),
    )


def _practice(study: WholeStudy) -> Iterator[Column]:
    """Of practice phases that are over."""
    for variable in (
        whole("practice_balls", "Balls reached in practice"),
        whole("practice_blocks_hit", "Blocks hit in practice"),
        number("practice_driven_s", "Time driven in practice", "s", low=0.0),
    ):
        name = variable.name.removeprefix("practice_")
        yield _of(
            study.people,
            variable,
            lambda one, name=name: one.practised and getattr(one.practised, name),
        )


def _attempts(study: WholeStudy) -> Iterator[Column]:
    """Tries at any rollout, calibration and teaching; flags are those of finished attempts."""
    finished = [one for one in study.attempts if one.status is AttemptStatus.FINISHED]
    made = Counter(one.participant for one in study.attempts)
    ended = Counter(one.participant for one in finished)
    flagged = Counter(one.participant for one in finished if one.key in study.flags)
    names: dict[str, set[str]] = {}
    for one in finished:
        names.setdefault(one.participant, set()).update(
            f.name for f in study.flags.get(one.key, ())
        )
    yield _of(
        study.people,
        whole("rollouts_finished", "Calibration rollouts with an attempt that counts"),
        lambda one: len(one.attempts),
    )
    yield _of(study.people, whole("attempts", "Attempts at all drives"), lambda one: made[one.id])
    yield _of(
        study.people,
        whole("attempts_not_finished", "Attempts that were abandoned or cut off"),
        lambda one: made[one.id] - ended[one.id],
    )
    yield _of(
        study.people,
        whole("attempts_flagged", "Finished attempts that broke a limit of timing"),
        lambda one: flagged[one.id],
    )
    yield _of(
        study.people,
        text("flags", "Limits of timing that were broken"),
        lambda one: ", ".join(sorted(names.get(one.id, ()))) or None,
    )


def _label_quality(study: WholeStudy) -> Iterator[Column]:
    """Labels of the calibration rollouts that count, against the ground truth."""
    series = by_person(study.series)
    yield _of(
        study.people,
        whole("labels", "Labels of calibration rollouts that can be judged"),
        lambda one: sum(int(s.valid.sum()) for s in series.get(one.id, ())),
    )
    yield _of(
        study.people,
        number("labels_valid_share", "Share of steps whose label can be judged", low=0.0, high=1.0),
        lambda one: _valid_share(series.get(one.id, ())),
    )
    label = "Mean absolute error of labels against the ground truth"
    yield _of(
        study.people,
        number("label_mae", label, "wheel units", low=0.0),
        lambda one: label_error(series.get(one.id, ())),
    )


def label_error(series: Sequence[LabelSeries]) -> float | None:
    """Mean of |label - truth| over all valid steps; None without any."""
    errors = [np.abs(one.label - one.truth)[one.valid] for one in series]
    together = np.concatenate(errors) if errors else np.empty(0)
    return float(together.mean()) if len(together) else None


def _valid_share(series: Sequence[LabelSeries]) -> float | None:
    steps = sum(one.steps for one in series)
    return sum(int(one.valid.sum()) for one in series) / steps if steps else None


STYLE = (
    number("style_amplitude", "Over- (+) or under-correction (-): Eq. 3 a point", "wheel units"),
    number("style_amplitude_total", "Eq. 3: signed sum along the path, mean of rollouts"),
    number("style_wrong_direction", "Share of labels on the wrong side of zero", low=0.0, high=1.0),
    number("style_lag_s", "Lag between scaled signals, positive late; the metric to use", "s"),
    number("style_lag_plain_s", "Lag along the paper's path, positive late", "s"),
    Variable(
        name="style_vote",
        label="The paper's majority vote",
        kind="whole",
        measure="ordinal",
        low=-1,
        high=1,
    ),
    number("style_voted_lag_s", "Lag by the paper's majority vote", "s"),
)
"""Each is the attribute of ``PersonStyle`` that follows ``style_``."""


def styles(study: WholeStudy) -> Mapping[str, PersonStyle]:
    """Everyone's style over the calibration rollouts that they finished."""
    latency = {one.id: one.latency_s for one in study.people if one.latency_s is not None}
    found = people_styles(study.series, latency_s=latency) if study.series else []
    return {style.person: style for style in found}


def _style(study: WholeStudy) -> Iterator[Column]:
    found = styles(study)
    for variable in STYLE:
        name = variable.name.removeprefix("style_")
        values = [getattr(found[p.id], name) if p.id in found else None for p in study.people]
        yield Column(
            variable=variable,
            values=[None if isinstance(value, NotComputable) else value for value in values],
        )


def _embedding(study: WholeStudy) -> Iterator[Column]:
    """Nothing where no network is frozen."""
    sizes = {len(one.embedding.w) for one in study.people if one.embedding is not None}
    for dimension in range(max(sizes, default=0)):
        label = f"Embedding w, dimension {dimension + 1} of {max(sizes)}"
        yield _of(
            study.people,
            number(f"w_{dimension + 1}", label),
            lambda one, at=dimension: one.embedding and one.embedding.w[at],
        )
    if not sizes:
        return
    yield _of(
        study.people,
        text("w_source", "How w was found"),
        lambda one: one.embedding and one.embedding.source,
    )
    yield _of(
        study.people,
        number("w_distance", "Distance of w from the training participants'", low=0.0),
        lambda one: one.embedding and one.embedding.distance,
    )
    yield _of(
        study.people,
        truth("w_outside", "They correct unlike the training participants"),
        lambda one: one.embedding and one.embedding.outside,
    )


def _conditions(study: WholeStudy) -> Iterator[Column]:
    """What came of each condition, as ``analyze`` sums it up."""
    rounds: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in study.rounds.to_pylist():
        place = (row["participant"], study.teach_phase(row["phase"]), row["condition"])
        rounds.setdefault(place, []).append(row)
    drives: dict[tuple[str, str, str, int], list[str]] = {}
    for row in study.trials.to_pylist():
        key = (row["participant"], study.teach_phase(row["phase"]), row["condition"], row["round"])
        drives.setdefault(key, []).append(row["outcome"])
    several = len(study.teach_phases) > 1
    for phase in study.teach_phases:
        for condition in study.conditions:
            name = (*((phase,) if several else ()), condition.key)
            taught = [rounds.get((one.id, phase, condition.key), []) for one in study.people]
            ended = [
                drives.get((one.id, phase, condition.key, of[-1]["round"]), []) if of else []
                for one, of in zip(study.people, taught, strict=True)
            ]
            yield from _condition(name, condition.title, taught, ended)


def _condition(
    name: tuple[str, ...],
    title: str,
    taught: Sequence[list[dict[str, Any]]],
    ended: Sequence[list[str]],
) -> Iterator[Column]:
    """One condition's columns.

    Args:
        taught: each person's rounds, in order; none of who was not taught it.
        ended: outcomes of the evaluation drives after the last of them.
    """

    def column(variable: Variable, values: list[Any]) -> Column:
        return Column(variable=variable, values=values)

    def named(what: str) -> str:
        return column_name(*name, what)

    last = [rounds[-1] if rounds else {} for rounds in taught]
    yield column(
        whole(named("position"), f"{title}: place in the order, from 1"),
        [one.get("position") or None for one in last],
    )
    yield column(
        whole(named("rounds"), f"{title}: rounds taught after the first drive"),
        [one.get("round") for one in last],
    )
    yield column(
        whole(named("drives"), f"{title}: evaluation drives after the last round"),
        [one.get("trials") for one in last],
    )
    yield column(
        number(
            named("success"), f"{title}: share that reached the ball, last round", low=0.0, high=1.0
        ),
        [one.get("success") for one in last],
    )
    yield column(
        number(
            named("final_distance_m"), f"{title}: mean final distance, last round", "m", low=0.0
        ),
        [one.get("final_distance_m") for one in last],
    )
    for outcome, words in (
        (Outcome.BLOCK_HIT, "hit a block"),
        (Outcome.OUT_OF_BOUNDS, "left the ground"),
        (Outcome.TIME_LIMIT, "ran out of time"),
    ):
        label = f"{title}: share that {words}, last round"
        yield column(
            number(named(f"{outcome.value}_share"), label, low=0.0, high=1.0),
            [of.count(outcome.value) / len(of) if of else None for of in ended],
        )
    after = [[row for row in rounds if row["round"] > 0] for rounds in taught]
    for key, label in (
        ("label_mae", "error of the labels that were imitated, mean over rounds"),
        ("given_mae", "error of the labels as given, mean over rounds"),
    ):
        yield column(
            number(named(key), f"{title}: {label}", "wheel units", low=0.0),
            [_mean([row[key] for row in rounds]) for rounds in after],
        )
    for key, label, made in (
        ("labels_asked", "labels asked for, all rounds", whole),
        ("teacher_s", "time the teacher was asked for, all rounds", number),
        ("switches", "changes of who drives, all rounds", whole),
    ):
        unit = "s" if key.endswith("_s") else ""
        yield column(
            made(named(key), f"{title}: {label}", unit),
            [sum(row[key] for row in rounds) if rounds else None for rounds in taught],
        )


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _durations(study: WholeStudy) -> Iterator[Column]:
    """Of each phase whose beginning is on record, in the order of the phases."""
    known = [{one.phase.id: one for one in person.times} for person in study.people]
    for phase in study.timed_phases:
        label = f"Duration of “{phase.title}”, from its first answer or drive to its end"
        yield Column(
            variable=number(column_name("duration", phase.id, "s"), label, "s", low=0.0),
            values=[of[phase.id].duration_s if phase.id in of else None for of in known],
        )
