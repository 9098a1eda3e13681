"""Long tables: a row for each answer, score, phase, session, attempt, round or drive; then the steps."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from steerlab.analysis.export.asked import answers_in_order, scores_of
from steerlab.analysis.export.steps import ATTEMPT, PERSON, ROLLOUT, labels_table, timing_table
from steerlab.analysis.export.tables import Column, ExportTable, made_table
from steerlab.analysis.export.variables import (
    Variable,
    choice,
    number,
    text,
    time,
    truth,
    whole,
)
from steerlab.analysis.export.wide import styles
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.study_data.asked import Missing
from steerlab.analysis.study_data.whole_study import WholeStudy
from steerlab.sim.rollout import Outcome
from steerlab.study.contract import PhaseKind, PhaseState
from steerlab.study.store.records import AttemptStatus

ANSWERED = "answered"
_STATES = {
    ANSWERED: "answered",
    Missing.NOT_ANSWERED.value: "the page was handed in without an answer",
    Missing.NOT_SHOWN.value: "not on the person's way, or skipped",
    Missing.NOT_REACHED.value: "the page is not handed in yet, or open again",
}
_CONDITION = text("condition", "What was taught; empty where it is about none")
_PHASE = text("phase", "Phase of the study")


def long_tables(study: WholeStudy, *, free_text: bool) -> list[ExportTable]:
    """All long tables that have a row."""
    makers: tuple[Callable[[], ExportTable], ...] = (
        lambda: _answers(study, free_text=free_text),
        lambda: _scores(study),
        lambda: _phases(study),
        lambda: _sessions(study),
        lambda: _attempts(study),
        lambda: _style(study),
        lambda: _rounds(study),
        lambda: _drives(study),
        lambda: labels_table(study),
        lambda: timing_table(study),
    )
    return [table for make in makers if (table := make()).data.num_rows]


def _rows(
    name: str,
    what: str,
    key: Sequence[str],
    variables: Sequence[Variable],
    rows: Sequence[Mapping[str, Any]],
    study: WholeStudy,
) -> ExportTable:
    """A table from a mapping for each row; what a row lacks is missing."""
    columns = [
        Column(variable=variable, values=[row.get(variable.name) for row in rows])
        for variable in variables
    ]
    return made_table(name, what, key, columns, study=study.id, rows=len(rows))


def _answers(study: WholeStudy, *, free_text: bool) -> ExportTable:
    variables = (
        PERSON,
        _PHASE,
        _CONDITION,
        text("questionnaire", "Key of the questionnaire"),
        whole("version", "Version of the questionnaire"),
        text("item", "Id of the item"),
        whole("place", "Place among the items as the participant saw them, from 1"),
        choice("state", "Whether there is an answer, and why not", _STATES),
        number("value", "The answer, if it is a number"),
        text("words", "The answer, if it is a choice or a text"),
    )
    rows = [
        {
            "participant": person.id,
            "phase": place.asking.phase,
            "condition": place.asking.condition,
            "questionnaire": place.questionnaire.key,
            "version": place.questionnaire.version,
            "item": item.id,
            "place": answered.shown.index(item.id) + 1 if item.id in answered.shown else None,
            "state": why.value if (why := answered.why_missing(item.id)) else ANSWERED,
            "words" if isinstance(answered.given.get(item.id), str) else "value": (
                answered.given.get(item.id)
            ),
        }
        for person, place, answered in answers_in_order(study)
        for item in place.items(free_text=free_text)
    ]
    key = ("participant", "phase", "condition", "questionnaire", "item")
    return _rows(
        "answers", "an item that a participant was or was not asked", key, variables, rows, study
    )


def _scores(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        _PHASE,
        _CONDITION,
        text("questionnaire", "Key of the questionnaire"),
        text("scale", "Key of the scale"),
        number("score", "The score; nothing is imputed"),
        number("rescaled", "(score - low) / (high - low)", low=0.0, high=1.0),
        whole("low", "The lowest score there can be"),
        whole("high", "The highest score there can be"),
        whole("answered", "Items answered"),
        whole("asked", "Items of the scale"),
        text("why_missing", "Why there is no score"),
    )
    rows = [
        {
            "participant": person.id,
            "phase": place.asking.phase,
            "condition": place.asking.condition,
            "questionnaire": place.questionnaire.key,
            "scale": scale,
            "score": one.score,
            "rescaled": one.rescaled,
            "low": one.low,
            "high": one.high,
            "answered": one.answered,
            "asked": one.asked,
            "why_missing": one.reason or None,
        }
        for person, place, answered in answers_in_order(study)
        for scale, one in scores_of(place, answered).items()
    ]
    key = ("participant", "phase", "condition", "questionnaire", "scale")
    what = "a scale of a page that a participant handed in"
    return _rows("scores", what, key, variables, rows, study)


def _phases(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        whole("number", "Place in the way through the study, from 1"),
        _PHASE,
        choice("kind", "Kind of phase", {kind.value: kind.value for kind in PhaseKind}),
        _CONDITION,
        choice("state", "How far it got", {state.value: state.value for state in PhaseState}),
        whole("times_reopened", "How often it was opened again"),
        time("started_utc", "First answer, or start at the wheel"),
        time("done_utc", "End"),
        number("duration_s", "From start to end, breaks included", "s", low=0.0),
    )
    rows = [
        {
            "participant": person.id,
            "number": index,
            "phase": one.phase.id,
            "kind": one.phase.kind.value,
            "condition": one.phase.condition,
            "state": one.state.value,
            "times_reopened": one.times_reopened,
            "started_utc": one.started_utc,
            "done_utc": one.done_utc,
            "duration_s": one.duration_s,
        }
        for person in study.people
        for index, one in enumerate(person.times, start=1)
    ]
    what = "a phase of a participant"
    return _rows("phases", what, ("participant", "phase"), variables, rows, study)


def _sessions(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        text("session", "Id of the session"),
        text("phase", "Phase it was held for"),
        time("started_utc", "Start"),
        text("input_kind", "What steered"),
        text("device_name", "Name of the device"),
        text("force_feedback", "Force feedback"),
        number("input_latency_s", "From the hand to the sample, as measured", "s", low=0.0),
        number("display_hz", "Pictures a second", "Hz", low=0.0),
        number("control_hz", "Control steps a second", "Hz", low=0.0),
        text("steerlab_version", "Version of steerlab that held it"),
    )
    rows = [
        {
            "participant": person.id,
            "session": one.id,
            "phase": one.settings.get("phase"),
            "input_latency_s": (
                None if one.input_latency_ms is None else one.input_latency_ms / 1000.0
            ),
        }
        | {
            name: getattr(one, name)
            for name in ("started_utc", "input_kind", "device_name", "force_feedback")
        }
        | {name: getattr(one, name) for name in ("display_hz", "control_hz", "steerlab_version")}
        for person in study.people
        for one in person.sessions
    ]
    return _rows("sessions", "a session at the wheel", ("session",), variables, rows, study)


def _attempts(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        ROLLOUT,
        ATTEMPT,
        whole("order_index", "Which of the participant's attempts at anything, from 0"),
        text("session", "Id of the session"),
        choice("status", "How it ended", {status.value: status.value for status in AttemptStatus}),
        text("end_reason", "Why it was abandoned"),
        truth("counted", "It is the one that counts of a calibration rollout"),
        truth("flagged", "It broke a limit of timing"),
        text("flags", "The limits, each with its value and its bound"),
    )
    counting = {one for person in study.people for one in person.attempts.values()}
    rows = [
        {
            "participant": one.participant,
            "rollout": one.rollout,
            "attempt": one.attempt,
            "order_index": one.order_index,
            "session": one.session,
            "status": one.status.value,
            "end_reason": one.end_reason and one.end_reason.partition(";")[0],  # no paths
            "counted": one in counting,
            "flagged": one.key in study.flags,
            "flags": "; ".join(
                f"{flag.name} {flag.value:g} > {flag.bound:g}"
                for flag in study.flags.get(one.key, ())
            )
            or None,
        }
        for one in study.attempts
    ]
    key = ("participant", "rollout", "attempt")
    return _rows("attempts", "a try at a drive", key, variables, rows, study)


def _style(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        ROLLOUT,
        whole("steps", "Steps whose label can be judged"),
        number("dtw_distance", "DTW distance between labels and truth", "wheel units", low=0.0),
        number("amplitude", "Over- (+) or under-correction (-): Eq. 3 a point", "wheel units"),
        number("amplitude_total", "Eq. 3: signed sum along the path"),
        number("wrong_direction", "Share of labels on the wrong side of zero", low=0.0, high=1.0),
        number("lag_s", "Median lag between scaled signals, positive late", "s"),
        number("lag_plain_s", "Mean lag along the paper's path, positive late", "s"),
    )
    rows: list[dict[str, Any]] = []
    for person in styles(study).values():
        for one in person.rollouts:
            parts = {
                "dtw_distance": one.distance,
                "amplitude": getattr(one.amplitude, "normalised", None),
                "amplitude_total": getattr(one.amplitude, "total", None),
                "wrong_direction": getattr(one.amplitude, "wrong_direction", None),
                "lag_s": getattr(one.timing_scaled, "median_lag_s", None),
                "lag_plain_s": getattr(one.timing, "lag_s", None),
            }
            known = {k: v for k, v in parts.items() if not isinstance(v, NotComputable)}
            rows.append(
                {"participant": one.person, "rollout": one.rollout, "steps": one.steps} | known
            )
    what = "a calibration rollout that a participant finished"
    return _rows("style", what, ("participant", "rollout"), variables, rows, study)


_OUTCOMES = {outcome.value: outcome.value.replace("_", " ") for outcome in Outcome}


def _rounds(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        _PHASE,
        whole("position", "Place of the condition in the participant's order, from 1"),
        _CONDITION,
        whole("round", "Round of teaching; 0 is the first drive"),
        number("success", "Share of evaluation drives that reached the ball", low=0.0, high=1.0),
        number("final_distance_m", "Mean distance to the ball at their ends", "m", low=0.0),
        whole("trials", "Evaluation drives"),
        number("label_mae", "Mean error of what was imitated", "wheel units", low=0.0),
        number("given_mae", "Mean error of what the person gave", "wheel units", low=0.0),
        whole("labels_asked", "Labels asked for"),
        number("teacher_s", "Time the teacher was asked for", "s", low=0.0),
        whole("switches", "Changes of who drives"),
        number("loss", "Loss of the policy after the round"),
    )
    key = ("participant", "phase", "round")
    return _rows("rounds", "a round of teaching", key, variables, study.rounds.to_pylist(), study)


def _drives(study: WholeStudy) -> ExportTable:
    variables = (
        PERSON,
        _PHASE,
        _CONDITION,
        whole("round", "Round of teaching whose policy drove"),
        whole("start", "Which of the starts, from 0"),
        choice("outcome", "How it ended", _OUTCOMES),
        number("final_distance_m", "Distance to the ball at the end", "m", low=0.0),
    )
    key, rows = ("participant", "phase", "round", "start"), study.trials.to_pylist()
    return _rows("drives", "an evaluation drive of a taught policy", key, variables, rows, study)
