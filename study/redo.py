"""Opening a finished phase again: what was recorded stays, and no longer counts."""

from steerlab.study.contract import PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.frozen_files import people_in_use
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import progress_of
from steerlab.study.store.people import PhaseAct, insert_phase_event


def redo(study: OpenStudy, participant: str, phase: str) -> None:
    """Open a phase again. Calibrating again opens the computation of w again as well.

    Raises:
        StudyError: the phase is not over, is consent, or the frozen network has learnt from it; or
            the participant has left.
    """
    connection = study.store.connection
    with connection.transaction(f"open {phase!r} of {participant!r} again", durable=True):
        place = progress_of(study, participant)
        view, at = place.view, place.phase(phase)
        if view.standing.withdrawn or view.standing is Standing.DECLINED:
            raise StudyError(f"{participant} has left ({view.standing}); nothing is redone.")
        if at.kind is PhaseKind.CONSENT:
            raise StudyError(f"Consent is given once; to end it, withdraw {participant}.")
        if place.state(phase) not in (PhaseState.DONE, PhaseState.SKIPPED):
            raise StudyError(f"{phase!r} of {participant} is not over yet; simply go on with it.")
        if at.kind is PhaseKind.CALIBRATION:
            if view.role is Role.TRAINING and participant in people_in_use(study):
                raise StudyError(
                    f"The network is frozen and has learnt from {participant}'s labels, so they "
                    f"stay as they are; enrol another training participant before the next study."
                )
            for later, state in view.phases:
                if later.kind is PhaseKind.CALIBRATE_W and state is PhaseState.DONE:
                    insert_phase_event(connection, participant, later.id, PhaseAct.REOPENED)
        insert_phase_event(connection, participant, phase, PhaseAct.REOPENED)
