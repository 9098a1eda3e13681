"""Checks of one participant: what is missing, attention, their device and the loop's timing."""

from collections.abc import Iterator, Mapping, Sequence

from steerlab.study.attention import attention_checks
from steerlab.study.contract import PhaseKind, PhaseState, StudyCheck
from steerlab.study.pages import consent_record, missing_answers
from steerlab.study.progress import ParticipantProgress, answers_of, finished_rollouts
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.teaching import read_taught
from steerlab.study.study_folder import OpenStudy
from steerlab.study.surveys.answer_format import InvalidAnswer
from steerlab.study.timing_words import in_words


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
        f"{attempt.rollout} ({words})"
        for attempt in (*rollouts.values(), *_taught(study, progress, finished))
        if (words := _flags(study, attempt))
    ]
    if flagged:
        result = f"the computer could not keep time in {', '.join(flagged)}"
        remedy = "Let them redo the rollouts, or leave these out as the protocol says."
        yield StudyCheck(what=view.id, found=result, ok=False, mend=remedy)
    yield from (check for check in page_findings(study, progress) if check.notice)
    if not (problems or unfinished or flagged):
        yield StudyCheck(what=view.id, found=f"{view.standing}, nothing missing", ok=True)


def page_findings(study: OpenStudy, progress: ParticipantProgress) -> Iterator[StudyCheck]:
    """What the experimenter should know of a participant's pages: age and attention.

    Nobody is left out by them here: that is for the analysis plan to say.
    """
    who = progress.view.id
    record = consent_record(study, progress)
    if record is not None and record.too_young:
        result = f"said to be younger than {record.text.minimum_age}, so the study ended there"
        yield StudyCheck(what=who, found=result, ok=True, notice=True)
    if record is not None and record.given and record.text.minimum_age is not None:
        for age in _ages(study, progress):
            if age < record.text.minimum_age:
                result = f"said to be {record.text.minimum_age} or older, and {age:g} afterwards"
                remedy = "Ask them; withdraw and erase them if they are too young."
                yield StudyCheck(what=who, found=result, ok=True, notice=True, mend=remedy)
    checks = attention_checks(study, progress)
    failed = [check for check in checks if not check.passed]
    if failed:
        said = ", ".join(
            f"{check.phase}: {check.questionnaire}.{check.item} is {check.given!r}, not "
            f"{check.expected!r}"
            for check in failed
        )
        result = f"failed {len(failed)} of {len(checks)} attention checks ({said})"
        remedy = "They count all the same, unless the analysis plan leaves them out."
        yield StudyCheck(what=who, found=result, ok=True, notice=True, mend=remedy)
    elif checks:
        result = f"passed {len(checks)} of {len(checks)} attention checks"
        yield StudyCheck(what=who, found=result, ok=True)


def _ages(study: OpenStudy, progress: ParticipantProgress) -> list[float]:
    """What a participant has answered to the shipped question of their age, wherever it is asked."""
    asked = {key for key, one in study.questionnaires.items() if one.original == "demographics"}
    return [
        float(age)
        for phase, _ in progress.view.phases
        if phase.kind is PhaseKind.QUESTIONNAIRES
        for key, given in answers_of(study, progress, phase.id).items()
        if key in asked and (age := given.get("age"))
    ]


def session_findings(study: OpenStudy, progress: ParticipantProgress) -> list[StudyCheck]:
    """A participant's pages, and device and timing of their sessions, for the console."""
    return [*page_findings(study, progress), *_device_findings(study, progress)]


def _device_findings(study: OpenStudy, progress: ParticipantProgress) -> list[StudyCheck]:
    participant = progress.view.id
    sessions = [s for s in study.store.sessions().values() if s.participant == participant]
    if not sessions:
        return []
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
    finished = study.store.attempts(AttemptStatus.FINISHED)
    rollouts = finished_rollouts(study, progress, finished)
    attempts = (*rollouts.values(), *_taught(study, progress, finished))
    broken = [
        f"{attempt.rollout} ({words})" for attempt in attempts if (words := _flags(study, attempt))
    ]
    result = f"drives finished: {len(attempts)}"
    if broken:
        result += f"; the computer could not keep time in {', '.join(broken)}"
    remedy = "Close other programs, and let them do these drives again." if broken else ""
    return [*checks, StudyCheck(what="Timing", found=result, ok=not broken, mend=remedy)]


def _flags(study: OpenStudy, attempt: Attempt) -> str:
    return in_words(flag.name for flag in study.store.flags(attempt))


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
        if lacking := set(phase.rollouts) - set(rollouts):
            yield f"{phase.id} is done, but lacks {', '.join(sorted(lacking))}"
