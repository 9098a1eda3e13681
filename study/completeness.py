"""What is missing of a participant, and how it stands with their device and the loop's timing."""

from collections.abc import Iterator, Mapping, Sequence

from steerlab.study.contract import PhaseKind, PhaseState, Standing, StudyCheck
from steerlab.study.opened import OpenStudy
from steerlab.study.pages import missing_answers
from steerlab.study.progress import ParticipantProgress, answers_of, finished_rollouts
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.teaching import read_taught
from steerlab.study.surveys.questionnaire import InvalidAnswer


def person_findings(
    study: OpenStudy, place: ParticipantProgress, finished: Sequence[Attempt]
) -> Iterator[StudyCheck]:
    """What is missing, out of range or flagged of one participant.

    Who has not finished yet is a notice: a study that is under way is in order.

    Args:
        finished: everybody's finished attempts.
    """
    view = place.view
    if view.standing in (Standing.ERASING, Standing.WITHDRAWN_ERASED):
        return
    rollouts = finished_rollouts(study, place, finished)
    problems = list(_missing(study, place, rollouts))
    for found, mend in problems:
        yield StudyCheck(what=view.id, found=found, ok=False, mend=mend)
    if unfinished := _unfinished(place):
        yield StudyCheck(what=view.id, found=unfinished, ok=True, notice=True)
    if skipped := [phase.id for phase, state in view.phases if state is PhaseState.SKIPPED]:
        reasons = {place.acts[phase][-1].detail for phase in skipped}
        found = f"skipped {', '.join(skipped)}: {'; '.join(sorted(reasons))}"
        yield StudyCheck(what=view.id, found=found, ok=True, notice=True)
    flagged = [
        f"{attempt.rollout} ({', '.join(flag.name for flag in flags)})"
        for attempt in (*rollouts.values(), *_taught(study, place, finished))
        if (flags := study.store.flags(attempt))
    ]
    if flagged:
        found = f"the computer could not keep time in {', '.join(flagged)}"
        mend = "Let them redo the rollouts, or leave these out as the protocol says."
        yield StudyCheck(what=view.id, found=found, ok=False, mend=mend)
    if not (problems or unfinished or flagged):
        yield StudyCheck(what=view.id, found=f"{view.standing}, nothing missing", ok=True)


def session_findings(study: OpenStudy, place: ParticipantProgress) -> list[StudyCheck]:
    """Device and timing of a participant's last session, for the console."""
    mine = [s for s in study.store.sessions().values() if s.participant == place.view.id]
    if not mine:
        return [StudyCheck(what="Session", found="none yet", ok=True)]
    last = mine[-1]
    found = [
        StudyCheck(what="Device", found=f"{last.device_name} ({last.input_kind})", ok=True),
        StudyCheck(what="Force feedback", found=last.force_feedback, ok=True),
    ]
    kinds = sorted({session.input_kind for session in mine})
    if len(kinds) > 1:
        mend = "Redo what was done with the wrong one."
        text = f"they steered with {', '.join(kinds)}"
        found.append(StudyCheck(what="Device", found=text, ok=False, mend=mend))
    if last.screen_px is not None and last.input_latency_ms is not None:
        width, height = last.screen_px
        text = f"{width} x {height}, {last.display_hz:g} Hz, {last.input_latency_ms:.1f} ms latency"
        found.append(StudyCheck(what="Display", found=text, ok=True))
    attempts = [
        a
        for a in study.store.attempts(AttemptStatus.FINISHED)
        if a.participant == place.view.id and a.session == last.id
    ]
    flags = [flag for attempt in attempts for flag in study.store.flags(attempt)]
    worst = sorted({flag.name for flag in flags})
    text = f"{len(attempts)} attempts finished"
    if flags:
        text += f"; limits broken: {', '.join(worst)}"
    mend = "Close other programs; see docs/running-a-study.md." if flags else ""
    return [*found, StudyCheck(what="Timing", found=text, ok=not flags, mend=mend)]


def _taught(
    study: OpenStudy, place: ParticipantProgress, finished: Sequence[Attempt]
) -> list[Attempt]:
    """The attempts that count of those that robots were taught in."""
    keys = {
        (one.rollout, one.attempt)
        for phase, _ in place.view.phases
        if phase.kind is PhaseKind.TEACH
        for one in read_taught(study.store.connection, place.view.id, phase.id)
    }
    return [
        one
        for one in finished
        if one.participant == place.view.id and (one.rollout, one.attempt) in keys
    ]


def _unfinished(place: ParticipantProgress) -> str:
    view = place.view
    if (phase := view.next_phase) is None:
        return ""
    left = sum(s not in (PhaseState.DONE, PhaseState.SKIPPED) for _, s in view.phases)
    return f"not finished yet: {left} of {len(view.phases)} phases are left, next {phase.id}"


def _missing(
    study: OpenStudy, place: ParticipantProgress, rollouts: Mapping[str, Attempt]
) -> Iterator[tuple[str, str]]:
    """In phases that are marked as done, nothing may be missing."""
    mend = "Open the phase again with study redo."
    for phase, state in place.view.phases:
        if state is not PhaseState.DONE:
            continue
        if missing := missing_answers(study, place, phase.id):
            items = ", ".join(f"{key}.{item}" for key, them in missing.items() for item in them)
            yield f"{phase.id} is done, but lacks answers: {items}", mend
        for key, given in answers_of(study, place, phase.id).items():
            for item, value in given.items():
                try:
                    study.questionnaires[key].check(item, value)
                except InvalidAnswer as error:
                    yield f"{phase.id}, {key}: {error}", mend
        lacking = set(place.protocol.rollouts) - set(rollouts)
        if phase.kind is PhaseKind.CALIBRATION and lacking:
            yield f"{phase.id} is done, but lacks {', '.join(sorted(lacking))}", mend
