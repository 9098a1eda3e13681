"""Networks for an analysis: trained without the held-out rollouts, one a seed, and judged on them."""

import logging
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from steerlab.analysis.study_data.records import Embeddings, HeldOut, Person, Role
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import StudySplit, split_rollouts, split_study
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.progress import Progress
from steerlab.study.derived import ErasedMeanwhile, ErasureGuard
from steerlab.study.models import frozen_model, load_frozen
from steerlab.study.study_folder import MODELS, OpenStudy

if TYPE_CHECKING:
    from steerlab.learning.mapper import LabelMapper, MindMeldMapper
    from steerlab.learning.presets import MapperConfig


_log = logging.getLogger(__name__)
_FEWEST_ROLLOUTS = 3  # of which one is held out
_FEWEST_PEOPLE = 3


def judge(
    mapper: "LabelMapper", held_out: Sequence[LabelSeries], *, seed: int, role: Role
) -> HeldOut | None:
    """Errors of ``mapper`` by person; None if nothing is held out."""
    people = tuple(dict.fromkeys(series.person for series in held_out))
    if not people:
        return None
    rows = {person: row for row, person in enumerate(people)}
    sums = np.zeros((len(people), 3))
    worsened, ratios, with_error = 0, 0.0, 0
    for series in held_out:
        before = np.abs(series.label - series.truth)[series.valid]
        after = np.abs(mapper.map(series) - series.truth)[series.valid]
        sums[rows[series.person]] += before.sum(), after.sum(), len(before)
        worsened += int((after > before).sum())
        wrong = before > 0.0
        ratios += float(((before[wrong] - after[wrong]) / before[wrong]).sum())
        with_error += int(wrong.sum())
    return HeldOut(
        seed=seed,
        role=role,
        people=people,
        before=sums[:, 0],
        after=sums[:, 1],
        labels=sums[:, 2].astype(np.int64),
        worsened=worsened,
        ratios=ratios,
        with_error=with_error,
    )


def judge_both(mapper: "LabelMapper", split: StudySplit, *, seed: int) -> list[HeldOut]:
    """Errors over the training and over the test participants, as far as labels are held out."""
    judged = (
        judge(mapper, split.held_out_seen, seed=seed, role="training"),
        judge(mapper, split.held_out_new, seed=seed, role="test"),
    )
    return [errors for errors in judged if errors is not None]


def network_for(
    split: StudySplit,
    config: "MapperConfig",
    *,
    seed: int,
    cache: Path,
    progress: Progress,
    placing: AbstractContextManager[None] | None = None,
) -> "MindMeldMapper":
    """A network trained on ``train_seen`` and calibrated on ``calibrate_new``.

    Kept in ``cache`` under a hash of labels, settings and seed, so that the next analysis of the
    same data need not train it again.

    Args:
        placing: held while the network's file gets its name; may refuse it.
    """
    from steerlab.learning.checkpoint import load_mapper, save_mapper
    from steerlab.learning.mapper import MindMeldMapper

    path = cache / f"analysis-{_fingerprint(split, config, seed)}.safetensors"
    if path.is_file():
        return load_mapper(path)
    mapper = MindMeldMapper(
        config,
        seed=seed,
        on_epoch=lambda done, of: progress(f"training, seed {seed}", done / of),
    )
    mapper.fit(split.train_seen)
    if split.calibrate_new:
        mapper.calibrate(split.calibrate_new)
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with whole_file(path, placing) as temporary:
            save_mapper(mapper, temporary)
    except OSError as error:  # a read-only medium costs the training anew, nothing else
        _log.warning("the network is not kept in %s: %s", cache, refusal(error, "see its rights"))
    return mapper


def embeddings_of(
    mapper: "MindMeldMapper",
    people: Sequence[str],
    *,
    seed: int,
    source: str,
    held_out: Sequence[str] = (),
) -> Embeddings | None:
    """The w of those of ``people`` whom the network was trained on; None if there is nobody.

    Args:
        held_out: rollouts that it was not fitted on.
    """
    from steerlab.learning.mapper import stack_embeddings

    known = tuple(p for p in people if p in mapper.people and p not in mapper.calibrated)
    if not known:
        return None
    w = stack_embeddings(mapper, known)
    return Embeddings(seed=seed, source=source, people=known, w=w, held_out=tuple(held_out))


def _fingerprint(split: StudySplit, config: "MapperConfig", seed: int) -> str:
    digest = sha256(repr((sorted(config.to_dict().items()), seed)).encode())
    for name in ("train_seen", "calibrate_new"):
        for series in getattr(split, name):
            digest.update(f"{name}\0{series.person}\0{series.rollout}\0{series.steps}\0".encode())
            digest.update(series.label.tobytes() + series.truth.tobytes())
    return digest.hexdigest()[:16]


def study_networks(
    study: OpenStudy,
    people: Sequence[Person],
    series: Sequence[LabelSeries],
    networks: int,
    progress: Progress,
    notices: list[str],
    guard: ErasureGuard,
) -> tuple[list[Embeddings], list[HeldOut]]:
    """The frozen network's w, then those of ``networks`` that hold rollouts out, with their errors.

    Args:
        notices: what the report should say is appended.
        guard: made before the study was read.
    """
    training = [person.id for person in people if person.role == "training"]
    test = [person.id for person in people if person.role == "test"]
    frozen = frozen_embeddings(study, training, notices)
    embeddings = [] if frozen is None else [frozen]
    held_out: list[HeldOut] = []
    protocol = study.current()
    # Earlier versions of a protocol may have had other rollouts; what was labelled is judged.
    present = {labels.rollout for labels in series}
    rollouts = [name for name in protocol.rollouts if name in present]
    rollouts += sorted(present - set(rollouts))
    if not networks:
        return embeddings, held_out
    if why := _untrainable(training, rollouts):
        notices.append(f"No network was trained for the analysis: {why}.")
        return embeddings, held_out
    from steerlab.learning.presets import preset

    config = preset(protocol.mapper.preset)
    if protocol.mapper.epochs is not None:
        config = replace(config, training=replace(config.training, epochs=protocol.mapper.epochs))
    for seed in range(protocol.seed, protocol.seed + networks):
        try:
            parts = split_rollouts(rollouts)
            split = split_study(series, parts, test)
            cache = study.folder / MODELS
            mapper = network_for(
                split, config, seed=seed, cache=cache, progress=progress, placing=guard.placing()
            )
            source = f"trained for the analysis with seed {seed}, without the held-out rollouts"
            w = embeddings_of(mapper, training, seed=seed, source=source, held_out=parts.held_out)
            errors = judge_both(mapper, split, seed=seed)
        except ErasedMeanwhile:
            raise
        except SteerlabError as error:  # the rest of the report does not need this network
            notices.append(f"No network could be trained and judged with seed {seed}: {error}")
            break
        embeddings += [] if w is None else [w]
        held_out += errors
    return embeddings, held_out


def frozen_embeddings(
    study: OpenStudy, training: Sequence[str], notices: list[str]
) -> Embeddings | None:
    """The training participants' w in the frozen network."""
    model = frozen_model(study)
    if model is None:
        notices.append(
            "No network is frozen: w can only be that of networks trained for this analysis."
        )
        return None
    try:
        mapper = load_frozen(study, model)
    except SteerlabError as error:
        notices.append(f"The frozen network cannot be used: {error}")
        return None
    embeddings = embeddings_of(mapper, training, seed=mapper.seed, source="the frozen network")
    known = () if embeddings is None else embeddings.people
    if strangers := [person for person in training if person not in known]:
        notices.append(
            f"{', '.join(strangers)} finished after the network was frozen, so they have no w from "
            f"it."
        )
    return embeddings


def _untrainable(training: Sequence[str], rollouts: Sequence[str]) -> str:
    if len(training) < _FEWEST_PEOPLE:
        return f"training participants who finished: {len(training)}; {_FEWEST_PEOPLE} are needed"
    if len(rollouts) < _FEWEST_ROLLOUTS:
        return f"rollouts: {len(rollouts)}; {_FEWEST_ROLLOUTS} are needed to hold one out"
    return ""
