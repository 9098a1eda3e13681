"""Is what was taught whole? For ``study verify``; reads no tensor, so it needs no torch."""

from collections.abc import Iterator, Sequence
from hashlib import sha256

from steerlab.study.contract import PhaseKind, PhaseState, Standing, StudyCheck
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import ParticipantProgress, everybody
from steerlab.study.store.teaching import TaughtRound, read_taught, read_tried


def teaching_findings(study: OpenStudy) -> Iterator[StudyCheck]:
    """Rounds, trials and policies of every teaching phase that is marked as done."""
    whole = 0
    for place in everybody(study):
        if place.view.standing in (Standing.ERASING, Standing.WITHDRAWN_ERASED):
            continue
        for phase, state in place.view.phases:
            if phase.kind is not PhaseKind.TEACH or state is not PhaseState.DONE:
                continue
            who = place.view.id
            rounds = read_taught(study.store.connection, who, phase.id)
            wrong = _missing(study, place, phase.id, rounds) or _changed(study, rounds)
            if wrong:
                mend = f"Restore the study from its last copy, or redo {phase.id} of {who}."
                yield StudyCheck(what=who, found=f"{phase.id}: {wrong}", ok=False, mend=mend)
            else:
                whole += len(rounds)
    if whole:
        found = f"{whole} rounds, their policies as they were kept"
        yield StudyCheck(what="Teaching", found=found, ok=True)


def _missing(
    study: OpenStudy, place: ParticipantProgress, phase: str, rounds: Sequence[TaughtRound]
) -> str | None:
    """What a phase that is done lacks."""
    wanted = place.protocol.demonstrations + 1
    if len(rounds) != wanted:
        return f"it is done, but has {len(rounds)} of {wanted} rounds"
    untried = {one.round for one in rounds} - read_tried(
        study.store.connection, place.view.id, phase
    )
    return f"the policies of rounds {sorted(untried)} were never tried" if untried else None


def _changed(study: OpenStudy, rounds: Sequence[TaughtRound]) -> str | None:
    """A policy that is not what was kept."""
    for taught in rounds:
        for name, digest in taught.policies.items():
            path = study.folder / name
            if not path.is_file():
                return f"{path} is missing"
            if sha256(path.read_bytes()).hexdigest() != digest:
                return f"{path} was changed"
    return None
