"""Fit and score fold by fold; pool what was predicted for labels that were held out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from time import perf_counter

import numpy as np
import torch

from steerlab.learning.calibration import encode
from steerlab.learning.folds import FoldPlan
from steerlab.learning.label_quality import LabelQuality, label_quality
from steerlab.learning.ladder import build_ladder
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import StudySplit
from steerlab.learning.training import torch_threads
from steerlab.learning.windows import make_windows
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

Progress = Callable[[str, float], None]
MIND_MELD = "mind_meld"

LEAST_TRAINING_STEPS = 400
"""Small tables give an epoch few batches; below so many steps MIND MELD has hardly begun."""

_WINDOWS_AT_ONCE = 100_000  # 17 MB of windows, some 150 MB while they are cut


MOST_TRAINING_LABELS = 400_000
"""The network is trained on whole people, drawn at random, up to so many labels; the other training
people get their embedding as new people do, the network frozen. It takes a hundred people or more
to get there, and holds a fit to a few minutes and a few hundred MB."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """One held-out series as MIND MELD mapped it, (steps,) NaN where there was no label."""

    series: LabelSeries
    split: str
    fold: int
    mapped: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossValidation:
    """Held-out results of all folds together, by split (``seen``, ``new``).

    Attributes:
        quality: by split and then method.
        predictions: each held-out series once.
    """

    quality: dict[str, dict[str, LabelQuality]]
    predictions: tuple[Prediction, ...]
    seconds: dict[str, float]
    notices: tuple[str, ...]


@dataclass(eq=False)
class _Pool:
    """Valid held-out labels so far; each list holds an array a series, ``person`` numbers."""

    numbers: dict[str, int] = field(default_factory=dict)
    person: list[np.ndarray] = field(default_factory=list)
    raw: list[FloatArray] = field(default_factory=list)
    truth: list[FloatArray] = field(default_factory=list)
    mapped: dict[str, list[FloatArray]] = field(default_factory=dict)


def cross_validate(
    plan: FoldPlan,
    config: MapperConfig,
    *,
    seed: int,
    progress: Progress,
    most_labels: int = MOST_TRAINING_LABELS,
) -> CrossValidation:
    """Fit each fold on what it trains on alone, and score all mappers on what it holds out.

    Raises:
        InvalidLabels: someone's labels cannot be learned from, or carry no error at all.
    """
    pools = {"seen": _Pool(), "new": _Pool()}
    predictions: list[Prediction] = []
    seconds = {"fit": 0.0, "calibrate": 0.0, "score": 0.0}
    notices: list[str] = []
    for number, parts in enumerate(plan.folds, start=1):
        name = f"fold {number} of {len(plan.folds)}"
        started = perf_counter()
        mapper, thinned = fit_within_budget(
            parts.train_seen,
            config,
            seed=seed,
            what=name,
            progress=progress,
            most_labels=most_labels,
        )
        fitted = perf_counter()
        if parts.calibrate_new:
            mapper.calibrate(parts.calibrate_new)
        calibrated = perf_counter()
        ladder = _ladder(mapper, parts, seed, progress)
        for split, held_out in (("seen", parts.held_out_seen), ("new", parts.held_out_new)):
            for one, mapped in zip(held_out, map_all(mapper, held_out), strict=True):
                predictions.append(Prediction(series=one, split=split, fold=number, mapped=mapped))
            _add(pools[split], ladder, held_out, predictions)
        progress(f"scoring {name}", 1.0)
        seconds["fit"] += fitted - started
        seconds["calibrate"] += calibrated - fitted
        seconds["score"] += perf_counter() - calibrated
        notices = notices or thinned
    started = perf_counter()
    quality = {
        split: {
            name: label_quality(
                np.concatenate(pool.person),
                np.concatenate(pool.raw),
                np.concatenate(mapped),
                np.concatenate(pool.truth),
                np.random.default_rng(seed),
            )
            for name, mapped in pool.mapped.items()
        }
        for split, pool in pools.items()
    }
    seconds["score"] += perf_counter() - started
    return CrossValidation(
        quality=quality, predictions=tuple(predictions), seconds=seconds, notices=tuple(notices)
    )


def fit_within_budget(
    series: Sequence[LabelSeries],
    config: MapperConfig,
    *,
    seed: int,
    what: str,
    progress: Progress,
    most_labels: int = MOST_TRAINING_LABELS,
) -> tuple[MindMeldMapper, list[str]]:
    """A mapper that knows everyone in ``series``; sentences about what the budget left out."""
    by_person: dict[str, list[LabelSeries]] = {}
    for one in series:
        by_person.setdefault(one.person, []).append(one)
    people = list(by_person)
    labels = np.array([sum(one.steps for one in by_person[person]) for person in people])
    drawn = np.random.default_rng(seed).permutation(len(people))
    affordable = int(np.searchsorted(np.cumsum(labels[drawn]), most_labels, "right"))
    trained = {people[index] for index in drawn[: max(2, affordable)]}
    chosen = [one for one in series if one.person in trained]
    mapper = MindMeldMapper(
        with_enough_steps(config, sum(int(one.valid.sum()) for one in chosen)),
        seed=seed,
        on_epoch=lambda done, of: progress(f"training, {what}", done / of),
    )
    mapper.fit(chosen)
    if len(trained) == len(people):
        return mapper, []
    rest = [one for one in series if one.person not in trained]
    progress(f"calibrating, {what}", 0.0)
    mapper.calibrate(rest)
    progress(f"calibrating, {what}", 1.0)
    return mapper, [
        f"The network was trained on {len(trained)} of {len(people)} people, drawn at random "
        f"({most_labels} labels are the most it is given); everyone else was calibrated "
        f"as new people are."
    ]


def with_enough_steps(config: MapperConfig, labels: int) -> MapperConfig:
    """``config``, with larger and then more epochs if ``labels`` would be too few for them."""
    training = config.training

    def batches(share: float) -> int:
        return max(1, ceil(share * labels / training.batch_size))

    steps = training.epochs * batches(training.share_per_epoch)
    if steps >= LEAST_TRAINING_STEPS:
        return config
    share = min(1.0, training.share_per_epoch * LEAST_TRAINING_STEPS / steps)
    epochs = max(training.epochs, ceil(LEAST_TRAINING_STEPS / batches(share)))
    return replace(config, training=replace(training, share_per_epoch=share, epochs=epochs))


def map_all(mapper: MindMeldMapper, series: Sequence[LabelSeries]) -> list[FloatArray]:
    """What ``mapper.map`` gives for each series, many at a time."""
    mapped: list[FloatArray] = []
    for several in _chunks(series):
        windows = make_windows(several, mapper.config.window)
        embeddings = torch.stack([mapper.embedding_tensor(person) for person in windows.people])
        with torch.no_grad(), torch_threads(1):
            encoding = encode(mapper.network, windows.inputs)
            difference = mapper.network.difference(encoding, embeddings[windows.person])
        label = np.concatenate([one.label for one in several])
        all_mapped = np.clip(
            label - difference.numpy().astype(np.float64), -WHEEL_LIMIT, WHEEL_LIMIT
        )
        mapped += np.split(all_mapped, np.cumsum([one.steps for one in several])[:-1])
    return mapped


def _ladder(
    mapper: MindMeldMapper, parts: StudySplit, seed: int, progress: Progress
) -> dict[str, LabelMapper]:
    """What MIND MELD is compared with, fitted and calibrated on the same labels, and itself."""
    return build_ladder(mapper, parts, seed=seed, on_step=progress, full=False)


def _add(
    pool: _Pool,
    ladder: Mapping[str, LabelMapper],
    held_out: Sequence[LabelSeries],
    predictions: Sequence[Prediction],
) -> None:
    ours = predictions[len(predictions) - len(held_out) :]
    for one, prediction in zip(held_out, ours, strict=True):
        number = pool.numbers.setdefault(one.person, len(pool.numbers))
        pool.person.append(np.full(int(one.valid.sum()), number, dtype=np.int32))
        pool.raw.append(one.label[one.valid])
        pool.truth.append(one.truth[one.valid])
        for name, mapper in ladder.items():
            mapped = prediction.mapped if name == MIND_MELD else mapper.map(one)
            pool.mapped.setdefault(name, []).append(mapped[one.valid])


def _chunks(series: Sequence[LabelSeries]) -> Iterator[list[LabelSeries]]:
    """Lists of about ``_WINDOWS_AT_ONCE`` steps, never empty."""
    chunk: list[LabelSeries] = []
    steps = 0
    for one in series:
        chunk.append(one)
        steps += one.steps
        if steps >= _WINDOWS_AT_ONCE:
            yield chunk
            chunk, steps = [], 0
    if chunk:
        yield chunk
