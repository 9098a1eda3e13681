"""How much MIND MELD is trained on a table of any size: long enough, and on no more than pays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.presets import MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import drive_names
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

CLEAN = 0.15
"""With less than this share of the error of its own training labels left, a table may be clean."""

LEAST_FALL = 0.8
"""Longer training must lower the error of held-out drives at least to this share of what it was."""

PILOT, LONGER, MOST_STEPS = 4, 20, 40_000
"""Times as many steps to see whether longer training helps, and where it does; steps at most."""

_MOST_LOOKED_AT = 200  # drives
_LEAST_DRIVES = 3


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
    """MIND MELD trained on ``series``, and nobody calibrated yet.

    A table of clean labels still gains when a noisy one has long converged. So where MIND MELD has
    removed nearly all error of what it was trained on, a tenth of the drives is held out, and if
    labels there say that longer training helps, everything is trained ``LONGER`` times as many
    steps. What is judged takes no part.
    """
    enough = with_enough_steps(config, valid_labels(series))

    def fitted(on: Sequence[LabelSeries], config: MapperConfig, again: str = "") -> MindMeldMapper:
        mapper = MindMeldMapper(
            config,
            seed=seed,
            on_epoch=lambda done, of: progress(f"MIND MELD, {what}{again}", done / of),
        )
        mapper.fit(on)
        return mapper

    first = fitted(series, enough)
    some = series[:: max(1, len(series) // _MOST_LOOKED_AT)]
    if not config.training.longer_if_clean or error_left(first, some) > CLEAN:
        return first
    rest, held_out = _hold_out(series)
    if not held_out:
        return first
    labels, again = valid_labels(rest), ", labels are clean"
    pilot = error_left(fitted(rest, enough, again), held_out)
    longer = error_left(fitted(rest, longer_for_clean(enough, labels, PILOT), again), held_out)
    if longer > LEAST_FALL * pilot:
        return first
    return fitted(series, longer_for_clean(enough, valid_labels(series), LONGER), again)


def error_left(mapper: MindMeldMapper, series: Sequence[LabelSeries]) -> float:
    """The share of the labels' absolute error that is left when they are mapped."""
    before = after = 0.0
    for one in series:
        mapped, valid = mapper.map(one), one.valid
        before += float(np.abs(one.label - one.truth)[valid].sum())
        after += float(np.abs(mapped - one.truth)[valid].sum())
    return after / before if before > 0.0 else 0.0


def longer_for_clean(config: MapperConfig, labels: int, factor: int) -> MapperConfig:
    """``config`` with ``factor`` times as many steps, smaller ones, and a lambda for clean labels.

    As the error of the difference vanishes, lambda alone is left to say where w goes; a hundredth
    of it does not hold clean labels back.
    """
    training, steps = config.training, factor * config.training.steps(max(labels, 1))
    training = replace(
        training,
        batch_size=min(SMALL_TABLE_BATCH, training.batch_size),
        rate=training.rate / 2.0,
        embedding_loss_weight=training.embedding_loss_weight / 100.0,
        epochs=1,
    )
    epochs = ceil(min(steps, MOST_STEPS) / training.steps(max(labels, 1)))
    return replace(config, training=replace(training, epochs=epochs))


def _hold_out(
    series: Sequence[LabelSeries],
) -> tuple[list[LabelSeries], list[LabelSeries]]:
    """All but a tenth of the drives, and that tenth; nothing is held out of fewer than three."""
    drives = drive_names(series)
    names = list(dict.fromkeys(drives[one.rollout] for one in series))
    held = set(names[::10]) if len(names) >= _LEAST_DRIVES else set[str]()
    rest = [one for one in series if drives[one.rollout] not in held]
    people = {one.person for one in rest if one.valid.any()}
    kept = [one for one in series if drives[one.rollout] in held and one.person in people]
    return [one for one in rest if one.person in people], [one for one in kept if one.valid.any()]


def valid_labels(series: Sequence[LabelSeries]) -> int:
    """How many labels may train."""
    return sum(int(one.valid.sum()) for one in series)


def with_enough_steps(config: MapperConfig, labels: int) -> MapperConfig:
    """``config``, with small batches and other epochs if ``labels`` would be too few for it."""
    training, labels = config.training, max(labels, 1)
    least = LEAST_TRAINING_STEPS * training.least_factor
    if training.steps(labels) >= least:
        return config
    training = replace(training, batch_size=min(SMALL_TABLE_BATCH, training.batch_size), epochs=1)
    training = replace(training, epochs=ceil(least / training.steps(labels)))
    return replace(config, training=training)
