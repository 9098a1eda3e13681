"""Opening a finished phase again, or some drives of a calibration."""

from collections.abc import Mapping, Sequence

from steerlab.study.contract import PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.progress import (
    ParticipantProgress,
    finished_rollouts,
    progress_of,
    reopened_detail,
)
from steerlab.study.store.forms import result_of, take
from steerlab.study.store.frozen import people_in_use
from steerlab.study.store.people import PhaseAct, insert_phase_event
from steerlab.study.study_folder import OpenStudy
from steerlab.study.timing_words import in_words


def redo(
    study: OpenStudy,
    participant: str,
    phase: str,
    *,
    rollouts: Sequence[str] = (),
    form: str | None = None,
) -> None:
    """Open a finished phase again; what was recorded stays and no longer counts.

    Calibrating again opens the computation of w again as well.

    Args:
        rollouts: only these of a calibration phase, which keeps the others; none stands for all.
        form: a key of what asks for it; the same key again changes nothing.

    Raises:
        StudyError: the phase is not over, is consent, has no such rollout, or the frozen network
            has learnt from it; or the participant has left.
    """
    connection = study.store.connection
    with connection.transaction(f"open {phase!r} of {participant!r} again", durable=True):
        if result_of(connection, form) is not None:
            return
        progress = progress_of(study, participant)
        view, opened = progress.view, progress.phase(phase)
        if view.standing.withdrawn or view.standing is Standing.DECLINED:
            raise StudyError(f"{participant} has left ({view.standing}); nothing is redone.")
        if opened.kind is PhaseKind.CONSENT:
            raise StudyError(f"Consent is given once; to end it, withdraw {participant}.")
        if not progress.state(phase).over:
            raise StudyError(f"{phase!r} of {participant} is not over yet; simply go on with it.")
        if unknown := [name for name in rollouts if name not in opened.rollouts]:
            known = ", ".join(opened.rollouts) or "none, as it is no calibration phase"
            raise StudyError(f"{phase!r} has no rollout {unknown[0]!r}; it has {known}.")
        if opened.kind is PhaseKind.CALIBRATION:
            if view.role is Role.TRAINING and participant in people_in_use(connection):
                raise StudyError(
                    f"The network is frozen and has learnt from {participant}'s labels, so "
                    f"they stay as they are; enrol another training participant before the "
                    f"next study."
                )
            for later, state in view.phases:
                if later.kind is PhaseKind.CALIBRATE_W and state is PhaseState.DONE:
                    insert_phase_event(connection, participant, later.id, PhaseAct.REOPENED)
        detail = reopened_detail(rollouts)
        insert_phase_event(connection, participant, phase, PhaseAct.REOPENED, detail)
        take(connection, form, "phase reopened")


def flags_of_drives(
    study: OpenStudy, progress: ParticipantProgress, phase: str
) -> Mapping[str, str]:
    """What was flagged, in words, of each rollout of a calibration phase that is finished.

    Empty words: nothing was.
    """
    finished = finished_rollouts(study, progress)
    return {
        name: in_words(flag.name for flag in study.store.flags(finished[name]))
        for name in progress.phase(phase).rollouts
        if name in finished
    }
