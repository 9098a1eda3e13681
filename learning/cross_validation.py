"""Fit and score fold by fold; pool what was predicted for labels that were held out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np

from steerlab.learning.baselines import fit_baselines, left_out
from steerlab.learning.baselines.auto import AutoMapper, Choice
from steerlab.learning.batch_mapping import map_in_chunks
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_quality import LabelQuality, LabelSums
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import FoldPlan, StudySplit, some_names
from steerlab.learning.training_budget import (
    MOST_TRAINING_LABELS,
    fit_long_enough,
    within_budget,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.progress import Progress, ShareProgress

MIND_MELD = "mind_meld"


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
        left_out: methods that were not judged, and why.
        predictions: each held-out series once.
        mapper: MIND MELD as the last fold fitted and calibrated it.
        notices: what the report should say, in sentences.
    """

    quality: dict[str, dict[str, LabelQuality]]
    left_out: dict[str, str]
    predictions: tuple[Prediction, ...]
    mapper: MindMeldMapper
    seconds: dict[str, float]
    notices: tuple[str, ...]


def cross_validate(
    plan: FoldPlan,
    config: MapperConfig,
    *,
    seed: int,
    progress: Progress,
    full: bool,
    most_labels: int = MOST_TRAINING_LABELS,
) -> CrossValidation:
    """Fit each fold on what it trains on alone, and score all mappers on what it holds out.

    Args:
        plan: what trains and what is held out.
        config: MIND MELD's settings; small tables get more epochs.
        seed: of all that is trained or drawn.
        progress: told what is being done and which share of it is.
        full: also judge the baselines that train a network of their own.
        most_labels: see ``MOST_TRAINING_LABELS``.

    Raises:
        InvalidLabels: someone's labels cannot be learned from, or carry no error at all.
    """
    sums: dict[str, dict[str, LabelSums]] = {"seen": {}, "new": {}}
    predictions: list[Prediction] = []
    seconds = {"fit": 0.0, "calibrate": 0.0, "ladder": 0.0, "score": 0.0}
    unlike: set[str] = set()
    unseen: set[str] = set()
    choices: list[Choice] = []
    mapper: MindMeldMapper | None = None
    budgets = [within_budget(fold.train_seen, seed, most_labels) for fold in plan.folds]
    folds = [
        replace(
            fold,
            train_seen=budget.trained,
            calibrate_new=(*budget.calibrated, *fold.calibrate_new),
        )
        for fold, budget in zip(plan.folds, budgets, strict=True)
    ]
    without = left_out(folds, config, full=full)
    for number, fold in enumerate(folds, start=1):
        name = f"fold {number} of {len(folds)}"
        started = perf_counter()
        mapper = fit_long_enough(fold.train_seen, config, seed, name, progress)
        fitted = perf_counter()
        mapper.calibrate(fold.calibrate_new)
        unlike |= {person for person in mapper.calibrated if mapper.calibration(person).outside}
        calibrated = perf_counter()
        baselines = fit_baselines(
            mapper,
            fold,
            seed=seed,
            on_step=partial(progress, f"rival mappers, {name}"),
            without=without,
        )
        built = perf_counter()
        if isinstance(auto := baselines.get("auto"), AutoMapper):
            choices.append(auto.choice)
            known = (*fold.train_seen, *fold.calibrate_new)
            unseen |= set(auto.unlike(sorted({one.person for one in known})))
        predictions += _score(baselines, fold, number, sums, partial(progress, f"scoring, {name}"))
        seconds["fit"] += fitted - started
        seconds["calibrate"] += calibrated - fitted
        seconds["ladder"] += built - calibrated
        seconds["score"] += perf_counter() - built
    if mapper is None:
        raise InvalidLabels("The plan has no fold; there is nothing to judge.")
    started = perf_counter()
    quality = {
        split: {
            baseline: pool.quality(np.random.default_rng(seed)) for baseline, pool in of.items()
        }
        for split, of in sums.items()
    }
    seconds["score"] += perf_counter() - started
    return CrossValidation(
        quality=quality,
        left_out=without,
        predictions=tuple(predictions),
        mapper=mapper,
        seconds=seconds,
        notices=(
            *next((budget.notices for budget in budgets if budget.notices), ()),
            *_unlike_notice(unlike),
            *_choice_notice(choices),
            *_unseen_notice(unseen),
        ),
    )


def _score(
    baselines: Mapping[str, LabelMapper],
    fold: StudySplit,
    number: int,
    sums: dict[str, dict[str, LabelSums]],
    on_share: ShareProgress,
) -> list[Prediction]:
    """Add what the fold holds out to ``sums``, by split and baseline; MIND MELD's predictions."""
    predictions: list[Prediction] = []
    count = len(fold.held_out_seen) + len(fold.held_out_new)
    for split, held_out in (("seen", fold.held_out_seen), ("new", fold.held_out_new)):
        for chunk, by_baseline in map_in_chunks(baselines, held_out):
            for baseline, all_mapped in by_baseline.items():
                pool = sums[split].setdefault(baseline, LabelSums())
                for drive, mapped in zip(chunk, all_mapped, strict=True):
                    valid = drive.valid
                    pool.add(drive.person, drive.label[valid], mapped[valid], drive.truth[valid])
            predictions += [
                Prediction(series=drive, split=split, fold=number, mapped=mapped)
                for drive, mapped in zip(chunk, by_baseline[MIND_MELD], strict=True)
            ]
            on_share(len(predictions) / count)
    return predictions


def _choice_notice(choices: Sequence[Choice]) -> tuple[str, ...]:
    """What ``auto`` blends, on average over the folds, and why."""
    if not choices:
        return ()
    mean = {name: 0.0 for choice in choices for name in choice.weights}
    for choice in choices:
        for name, weight in choice.weights.items():
            mean[name] += weight / len(choices)
    parts = [f"{weight:.0%} {name}" for name, weight in sorted(mean.items(), key=lambda x: -x[1])]
    each = "each fold chooses for itself; " if len(choices) > 1 else ""
    left = {name: why for choice in choices for name, why in choice.left_out.items()}
    without = [f" It did without {name}: {why}" for name, why in left.items()]
    return (
        f"auto, the mapper to use here, blends {', '.join(parts)} ({each}the last: "
        f"{choices[-1]}).{''.join(without)}",
    )


def _unseen_notice(people: set[str]) -> tuple[str, ...]:
    if not people:
        return ()
    return (
        f"{some_names(sorted(people))}: labels or truths unlike any that sim_pretrained was taught "
        f"with, so it may do worse for them than its figures elsewhere say.",
    )


def _unlike_notice(people: set[str]) -> tuple[str, ...]:
    if not people:
        return ()
    return (
        f"{some_names(sorted(people))}: when new to MIND MELD, of a style unlike the training "
        f"people’s. Look at their labels before trusting the mapped ones.",
    )
