"""The network that is trained on training participants and frozen, and each test person's w."""

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.sim.files.shared_folder import remove
from steerlab.sim.files.whole_file import rename_durably, whole_file, workspace
from steerlab.sim.progress import Progress
from steerlab.study.contract import PhaseKind, PhaseState, Role, Standing, StudyError
from steerlab.study.progress import ParticipantProgress, everybody, finished_rollouts, progress_of
from steerlab.study.store.frozen import (
    FrozenModel,
    StoredEmbedding,
    insert_embedding,
    insert_model,
    mark_model_removed,
    read_embeddings,
    read_models,
)
from steerlab.study.study_folder import MODELS, OpenStudy

if TYPE_CHECKING:
    from steerlab.learning.mapper import MindMeldMapper


def frozen_model(study: OpenStudy) -> FrozenModel | None:
    """The network in use; None before training, and after its removal."""
    models = read_models(study.store.connection)
    in_use = [model for model in models if model.removed_utc is None]
    return in_use[-1] if in_use else None


def training_people(study: OpenStudy) -> list[ParticipantProgress]:
    """Training participants who finished, or who left their data after they had calibrated."""
    people: list[ParticipantProgress] = []
    for person in everybody(study):
        calibrations = [state for phase, state in person.view.phases if phase.rollouts]
        if (
            person.view.role is Role.TRAINING
            and person.view.standing in (Standing.FINISHED, Standing.WITHDRAWN_KEPT)
            and calibrations
            and all(state is PhaseState.DONE for state in calibrations)
        ):
            people.append(person)
    return people


def check_people(study: OpenStudy) -> list[ParticipantProgress]:
    """All training people.

    Raises:
        StudyError: they are too few to train on.
    """
    people, fewest = training_people(study), study.current().mapper.minimum_people
    if len(people) < fewest:
        raise StudyError(
            f"{len(people)} training participants have finished; the protocol asks for {fewest} "
            "(mapper.minimum_people) before the network is trained."
        )
    return people


def train(study: OpenStudy, progress: Progress) -> FrozenModel:
    """Train the network on all training people, freeze it, and find each test participant's w.

    Raises:
        StudyError: there is a frozen network already and every w is from it, or too few people
            finished.
    """
    if (known := frozen_model(study)) is not None:
        if _recalibrate(study, known, progress):
            return known
        raise StudyError(
            f"The network is frozen since {known.at_utc} ({known.file}); test participants are "
            f"compared under one network, so it is not trained again."
        )
    plan, seed = study.current().mapper, study.current().seed
    people = check_people(study)
    from steerlab.learning.checkpoint import save_mapper
    from steerlab.learning.mapper import MindMeldMapper
    from steerlab.learning.presets import preset

    config = preset(plan.preset)
    if plan.epochs is not None:
        config = replace(config, training=replace(config.training, epochs=plan.epochs))
    series = [rollout for person in people for rollout in _series(study, person)]
    mapper = MindMeldMapper(
        config, seed=seed, on_epoch=lambda done, all_: progress("training the network", done / all_)
    )
    folder = study.folder / MODELS
    folder.mkdir(exist_ok=True)
    names = [person.view.id for person in people]
    inputs = _fingerprint(series)
    with workspace(folder / "mind_meld") as room:  # first: training takes long
        mapper.fit(series)
        part = room / "mind_meld.safetensors"
        save_mapper(mapper, part)
        digest = sha256(part.read_bytes()).hexdigest()
        file = f"{MODELS}/mind_meld-{digest[:12]}.safetensors"
        rename_durably(part, study.folder / file)
    with study.store.connection.transaction("freeze the network", durable=True):
        insert_model(study.store.connection, file=file, sha256=digest, people=names, inputs=inputs)
    frozen = frozen_model(study)
    assert frozen is not None
    _recalibrate(study, frozen, progress)
    return frozen


def load_frozen(study: OpenStudy, model: FrozenModel) -> "MindMeldMapper":
    """The network, if its file is what was frozen.

    Raises:
        StudyError: the file is missing or was changed.
    """
    path = study.folder / model.file
    now = sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
    if now != model.sha256:
        raise StudyError(
            f"{path} is not the network that was frozen: its sha256 is {now}, it was "
            f"{model.sha256}. Restore it from the last copy of the study."
        )
    from steerlab.learning.checkpoint import load_mapper

    return load_mapper(path)


def calibrate_participant(
    study: OpenStudy, participant: str, progress: Progress
) -> StoredEmbedding:
    """Find a test participant's w, the network frozen, and keep it; trains the network if need be.

    Raises:
        StudyError: the participant has not finished calibration, or no network can be trained.
    """
    model = frozen_model(study) or train(study, progress)
    person = progress_of(study, participant)
    missing = set(person.rollouts) - set(finished_rollouts(study, person))
    if missing:
        raise StudyError(
            f"{participant} has not corrected {', '.join(sorted(missing))} yet; finish that first."
        )
    from steerlab.learning.checkpoint import save_mapper

    mapper = load_frozen(study, model)
    series = _series(study, person)
    mapper.calibrate(series)
    calibrated = mapper.calibration(participant)
    embedding = StoredEmbedding(
        participant=participant,
        model_sha256=model.sha256,
        w=calibrated.embedding,
        covariance=calibrated.covariance,
        distance=calibrated.distance,
        outside=calibrated.outside,
        inputs=_fingerprint(series),
    )
    with whole_file(person_file(study, model, participant)) as part:
        save_mapper(mapper, part)
    with study.store.connection.transaction(f"keep w of {participant!r}", durable=True):
        insert_embedding(study.store.connection, embedding)
    return embedding


def person_file(study: OpenStudy, model: FrozenModel, participant: str) -> Path:
    """The file that holds the network and one test participant's w, to map their labels."""
    base = study.folder / model.file
    return base.with_name(f"{base.stem}-{participant}.safetensors")


def remove_models_of(study: OpenStudy, participant: str) -> None:
    """Remove the network that was trained on the participant's labels, and every w from it.

    Also files that a crash left without a row: whose labels are in them is unknown.
    """
    for model in read_models(study.store.connection):
        if participant in model.people and model.removed_utc is None:
            with study.store.connection.transaction("remove the network", durable=True):
                mark_model_removed(study.store.connection, model, f"{participant} was erased")
    in_use = frozen_model(study)
    keep = Path(in_use.file).stem if in_use is not None else None
    for path in sorted((study.folder / MODELS).glob("*")):  # hidden parts too
        known = path.name.casefold().endswith((".safetensors", ".part"))
        if known and (keep is None or not path.name.startswith(keep)):
            remove(path)  # a workspace of somebody who is at work, or a file


def renew(study: OpenStudy, progress: Progress) -> None:
    """After a removal: train anew if enough people are left, and find each w under the new network.

    Calling it again changes nothing.
    """
    if not read_models(study.store.connection):
        return
    model = frozen_model(study)
    if model is not None:
        _recalibrate(study, model, progress)
    elif len(training_people(study)) >= study.current().mapper.minimum_people:
        train(study, progress)


def _recalibrate(study: OpenStudy, model: FrozenModel, progress: Progress) -> int:
    """Find anew each w that comes from a network that was removed; returns how many there were."""
    known = read_embeddings(study.store.connection)
    count = 0
    for person in everybody(study):
        embedding, phase = known.get(person.view.id), person.of_kind(PhaseKind.CALIBRATE_W)
        done = phase is not None and person.state(phase.id) is PhaseState.DONE
        if done and embedding is not None and embedding.model_sha256 != model.sha256:
            calibrate_participant(study, person.view.id, progress)
            count += 1
    return count


def _series(study: OpenStudy, person: ParticipantProgress) -> list[LabelSeries]:
    """A participant's labels of the attempts that count, one series a rollout."""
    attempts = finished_rollouts(study, person)
    tables = [study.store.steps(attempts[name]) for name in sorted(attempts)]
    return series_from_table(pa.concat_tables(tables)) if tables else []


def _fingerprint(series: Sequence[LabelSeries]) -> str:
    """Hash of labels and truth, to the bit."""
    digest = sha256()
    for rollout in series:
        digest.update(f"{rollout.person}\0{rollout.rollout}\0{rollout.steps}\0".encode())
        for values in (rollout.label, rollout.truth):
            digest.update(values.tobytes())
    return digest.hexdigest()
