"""Checks of one participant: what is missing of them, and their device and the loop's timing."""

from collections.abc import Iterator, Mapping, Sequence

from steerlab.study.contract import PhaseKind, PhaseState, StudyCheck
from steerlab.study.pages import missing_answers
from steerlab.study.progress import ParticipantProgress, answers_of, finished_rollouts
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.teaching import read_taught
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import InvalidAnswer


def person_findings(
    study: OpenStudy, progress: ParticipantProgress, finished: Sequence[Attempt]
) -> Iterator[StudyCheck]:
    """What is missing, out of range or flagged of one participant.

    Who has not finished yet is a notice: a study that is under way is in order.

    Args:
        finished: everybody's finished attempts.
    """
    view = progress.view
    if view.standing.erased:
        return
    rollouts = finished_rollouts(study, progress, finished)
    problems = list(_missing(study, progress, rollouts))
    for problem in problems:
        remedy = "Open the phase again with study redo."
        yield StudyCheck(what=view.id, found=problem, ok=False, mend=remedy)
    if unfinished := _unfinished(progress):
        yield StudyCheck(what=view.id, found=unfinished, ok=True, notice=True)
    if skipped := [phase.id for phase, state in view.phases if state is PhaseState.SKIPPED]:
        reasons = {progress.acts[phase][-1].detail for phase in skipped}
        result = f"skipped {', '.join(skipped)}: {'; '.join(sorted(reasons))}"
        yield StudyCheck(what=view.id, found=result, ok=True, notice=True)
    flagged = [
        f"{attempt.rollout} ({', '.join(flag.name for flag in flags)})"
        for attempt in (*rollouts.values(), *_taught(study, progress, finished))
        if (flags := study.store.flags(attempt))
    ]
    if flagged:
        result = f"the computer could not keep time in {', '.join(flagged)}"
        remedy = "Let them redo the rollouts, or leave these out as the protocol says."
        yield StudyCheck(what=view.id, found=result, ok=False, mend=remedy)
    if not (problems or unfinished or flagged):
        yield StudyCheck(what=view.id, found=f"{view.standing}, nothing missing", ok=True)


def session_findings(study: OpenStudy, progress: ParticipantProgress) -> list[StudyCheck]:
    """Device and timing of a participant's last session, for the console."""
    participant = progress.view.id
    sessions = [s for s in study.store.sessions().values() if s.participant == participant]
    if not sessions:
        return [StudyCheck(what="Session", found="none yet", ok=True)]
    last = sessions[-1]
    checks = [
        StudyCheck(what="Device", found=f"{last.device_name} ({last.input_kind})", ok=True),
        StudyCheck(what="Force feedback", found=last.force_feedback, ok=True),
    ]
    kinds = sorted({session.input_kind for session in sessions})
    if len(kinds) > 1:
        remedy = "Redo what was done with the wrong one."
        result = f"they steered with {', '.join(kinds)}"
        checks.append(StudyCheck(what="Device", found=result, ok=False, mend=remedy))
    if last.screen_px is not None and last.input_latency_ms is not None:
        width, height = last.screen_px
        result = (
            f"{width} x {height}, {last.display_hz:g} Hz, {last.input_latency_ms:.1f} ms latency"
        )
        checks.append(StudyCheck(what="Display", found=result, ok=True))
    attempts = [
        attempt
        for attempt in study.store.attempts(AttemptStatus.FINISHED)
        if attempt.participant == participant and attempt.session == last.id
    ]
    broken = sorted({flag.name for attempt in attempts for flag in study.store.flags(attempt)})
    result = f"{len(attempts)} attempts finished"
    if broken:
        result += f"; limits broken: {', '.join(broken)}"
    remedy = "Close other programs; see docs/running-a-study.md." if broken else ""
    return [*checks, StudyCheck(what="Timing", found=result, ok=not broken, mend=remedy)]


def _taught(
    study: OpenStudy, progress: ParticipantProgress, finished: Sequence[Attempt]
) -> list[Attempt]:
    """The participant's attempts that robots were taught from and that count."""
    participant = progress.view.id
    keys = {
        (participant, taught.rollout, taught.attempt)
        for phase, _ in progress.view.phases
        if phase.kind is PhaseKind.TEACH
        for taught in read_taught(study.store.connection, participant, phase.id)
    }
    return [attempt for attempt in finished if attempt.key in keys]


def _unfinished(progress: ParticipantProgress) -> str:
    view = progress.view
    if (phase := view.next_phase) is None:
        return ""
    left = sum(not state.over for _, state in view.phases)
    return f"not finished yet: {left} of {len(view.phases)} phases are left, next {phase.id}"


def _missing(
    study: OpenStudy, progress: ParticipantProgress, rollouts: Mapping[str, Attempt]
) -> Iterator[str]:
    """What is missing or out of range in phases that are marked as done."""
    for phase, state in progress.view.phases:
        if state is not PhaseState.DONE:
            continue
        if missing := missing_answers(study, progress, phase.id):
            items = ", ".join(f"{key}.{item}" for key, ids in missing.items() for item in ids)
            yield f"{phase.id} is done, but lacks answers: {items}"
        for key, given in answers_of(study, progress, phase.id).items():
            for item, value in given.items():
                try:
                    study.questionnaires[key].check(item, value)
                except InvalidAnswer as error:
                    yield f"{phase.id}, {key}: {error}"
        lacking = set(progress.protocol.rollouts) - set(rollouts)
        if phase.kind is PhaseKind.CALIBRATION and lacking:
            yield f"{phase.id} is done, but lacks {', '.join(sorted(lacking))}"
