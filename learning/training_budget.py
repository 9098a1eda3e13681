"""How much MIND MELD is trained on a table of any size: long enough, and on no more than pays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.presets import MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.sim.progress import Progress

LEAST_TRAINING_STEPS = 400
"""Small tables give an epoch few batches; below so many steps MIND MELD has hardly begun."""

SMALL_TABLE_BATCH = 128
"""Windows a step where the preset gives fewer steps than that: as good as the preset's 512, in a third
of the time (docs/mapper-experiments.md, Small tables)."""

MOST_TRAINING_LABELS = 400_000
"""All that people share (networks, priors, penalties) is learned of whole people, drawn at random, up
to so many labels; the other training people are calibrated as new people are. It takes a hundred
people or more to get there, and holds time and memory of a fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Budgeted:
    """The training people's series: what is trained on, and who is calibrated instead."""

    trained: tuple[LabelSeries, ...]
    calibrated: tuple[LabelSeries, ...]
    notices: tuple[str, ...]


def fit_within_budget(
    series: Sequence[LabelSeries],
    config: MapperConfig,
    *,
    seed: int,
    what: str,
    progress: Progress,
    most_labels: int = MOST_TRAINING_LABELS,
) -> MindMeldMapper:
    """A mapper that knows everyone in ``series``."""
    budget = within_budget(series, seed, most_labels)
    mapper = fit_long_enough(budget.trained, config, seed, what, progress)
    if budget.calibrated:
        mapper.calibrate(budget.calibrated)
    return mapper


def within_budget(
    series: Sequence[LabelSeries], seed: int, most_labels: int = MOST_TRAINING_LABELS
) -> Budgeted:
    """Whole people drawn at random, at least two, up to ``most_labels``; the others apart."""
    labels: dict[str, int] = {}
    for one in series:
        labels[one.person] = labels.get(one.person, 0) + one.steps
    people = list(labels)
    drawn = np.random.default_rng(seed).permutation(len(people))
    spent = np.cumsum([labels[people[index]] for index in drawn])
    affordable = int(np.searchsorted(spent, most_labels, "right"))
    trained = {people[index] for index in drawn[: max(2, affordable)]}
    rest = tuple(one for one in series if one.person not in trained)
    notice = (
        f"Networks and whatever else people share were learned of {len(trained)} of {len(people)} "
        f"people, drawn at random ({most_labels} labels are the most they are given); everyone "
        f"else was calibrated as new people are."
    )
    return Budgeted(
        trained=tuple(one for one in series if one.person in trained),
        calibrated=rest,
        notices=(notice,) if rest else (),
    )


def fit_long_enough(
    series: Sequence[LabelSeries], config: MapperConfig, seed: int, what: str, progress: Progress
) -> MindMeldMapper:
    """MIND MELD trained on ``series``, and nobody calibrated yet."""
    mapper = MindMeldMapper(
        with_enough_steps(config, valid_labels(series)),
        seed=seed,
        on_epoch=lambda done, of: progress(f"MIND MELD, {what}", done / of),
    )
    mapper.fit(series)
    return mapper


def valid_labels(series: Sequence[LabelSeries]) -> int:
    """How many labels may train."""
    return sum(int(one.valid.sum()) for one in series)


def with_enough_steps(config: MapperConfig, labels: int) -> MapperConfig:
    """``config``, with small batches and other epochs if ``labels`` would be too few for it."""
    training, labels = config.training, max(labels, 1)
    if training.steps(labels) >= LEAST_TRAINING_STEPS:
        return config
    training = replace(training, batch_size=min(SMALL_TABLE_BATCH, training.batch_size), epochs=1)
    training = replace(training, epochs=ceil(LEAST_TRAINING_STEPS / training.steps(labels)))
    return replace(config, training=training)
