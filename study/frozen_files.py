"""Are the network and the participants' w what was frozen? Reads no tensor, so it needs no torch."""

from collections.abc import Iterator
from hashlib import sha256

from steerlab.study.contract import PhaseKind, PhaseState, StudyCheck
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import everybody
from steerlab.study.store.frozen import read_embeddings, read_models

MODELS = "models"


def model_findings(study: OpenStudy) -> Iterator[StudyCheck]:
    """The network's file, and whether every w comes from it."""
    models = read_models(study.store.connection)
    in_use = [one for one in models if one.removed_utc is None]
    mend = "Restore it from the last copy of the study."
    for one in in_use:
        path = study.folder / one.file
        if not path.is_file():
            yield StudyCheck(what="Network", found=f"{path} is missing", ok=False, mend=mend)
        elif sha256(path.read_bytes()).hexdigest() != one.sha256:
            yield StudyCheck(what="Network", found=f"{path} was changed", ok=False, mend=mend)
        else:
            found = f"{one.file} of {len(one.people)} people, as frozen"
            yield StudyCheck(what="Network", found=found, ok=True)
    hashes = {one.sha256 for one in in_use}
    known = read_embeddings(study.store.connection)
    for place in everybody(study):
        participant, phase = place.view.id, place.of_kind(PhaseKind.CALIBRATE_W)
        mine = known.get(participant)
        if phase is None or place.state(phase.id) is not PhaseState.DONE:
            continue
        if mine is None:
            found = f"{participant} has no w, though {phase.id} is done"
            mend = f"Open the phase again: steerlab study redo DIR {participant} {phase.id}"
            yield StudyCheck(what="Network", found=found, ok=False, mend=mend)
            continue
        if mine.model_sha256 not in hashes:
            found = f"w of {participant} comes from a network that was removed"
            mend = "Once enough training participants have finished: steerlab study train DIR"
            yield StudyCheck(what="Network", found=found, ok=False, mend=mend)
        if mine.outside:
            found = f"{participant} corrects unlike the training participants"
            mend = "Look at their labels before trusting the mapped ones."
            yield StudyCheck(what="Network", found=found, ok=True, mend=mend, notice=True)


def people_in_use(study: OpenStudy) -> set[str]:
    """Whose labels the network in use was trained on."""
    models = read_models(study.store.connection)
    return {person for one in models if one.removed_utc is None for person in one.people}
