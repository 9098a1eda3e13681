"""Networks for an analysis: judged on rollouts they were not trained on, trained anew per seed."""

from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from steerlab.analysis.study_data.records import Embeddings, HeldOut, Role
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import StudySplit
from steerlab.sim.files.whole_file import whole_file

if TYPE_CHECKING:
    from steerlab.learning.mapper import LabelMapper, MindMeldMapper
    from steerlab.learning.presets import MapperConfig

Progress = Callable[[str, float], None]
"""Told what is being done and which share of it is, 0 to 1."""


def judge(
    mapper: "LabelMapper", held_out: Sequence[LabelSeries], *, seed: int, role: Role
) -> HeldOut | None:
    """Errors of ``mapper`` by person; None if nothing is held out."""
    people = tuple(dict.fromkeys(one.person for one in held_out))
    if not people:
        return None
    rows = {person: row for row, person in enumerate(people)}
    sums = np.zeros((len(people), 3))
    worsened, ratios, with_error = 0, 0.0, 0
    for one in held_out:
        before = np.abs(one.label - one.truth)[one.valid]
        after = np.abs(mapper.map(one) - one.truth)[one.valid]
        sums[rows[one.person]] += before.sum(), after.sum(), len(before)
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


def network_for(
    parts: StudySplit, config: "MapperConfig", *, seed: int, cache: Path, progress: Progress
) -> "MindMeldMapper":
    """A network trained on ``train_seen`` and calibrated on ``calibrate_new``.

    Kept in ``cache`` under a hash of labels, settings and seed, so that the next analysis of the
    same data need not train it again.
    """
    from steerlab.learning.checkpoint import load_mapper, save_mapper
    from steerlab.learning.mapper import MindMeldMapper

    path = cache / f"analysis-{_fingerprint(parts, config, seed)}.safetensors"
    if path.is_file():
        return load_mapper(path)
    mapper = MindMeldMapper(
        config,
        seed=seed,
        on_epoch=lambda done, of: progress(f"training, seed {seed}", done / of),
    )
    mapper.fit(parts.train_seen)
    if parts.calibrate_new:
        mapper.calibrate(parts.calibrate_new)
    cache.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as fresh:
        save_mapper(mapper, fresh)
    return mapper


def embeddings_of(
    mapper: "MindMeldMapper", people: Sequence[str], *, seed: int, source: str
) -> Embeddings | None:
    """The w of those of ``people`` whom the network was trained on; None if it is nobody."""
    from steerlab.learning.mapper import stack_embeddings

    known = tuple(p for p in people if p in mapper.people and p not in mapper.calibrated)
    if not known:
        return None
    return Embeddings(seed=seed, source=source, people=known, w=stack_embeddings(mapper, known))


def _fingerprint(parts: StudySplit, config: "MapperConfig", seed: int) -> str:
    digest = sha256(repr((sorted(config.to_dict().items()), seed)).encode())
    for name in ("train_seen", "calibrate_new"):
        for one in getattr(parts, name):
            digest.update(f"{name}\0{one.person}\0{one.rollout}\0{one.steps}\0".encode())
            digest.update(one.label.tobytes() + one.truth.tobytes())
    return digest.hexdigest()[:16]
