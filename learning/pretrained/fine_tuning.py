"""Fine-tune the shipped network on a study's own training people, and keep it only if it helps.

Teachers outside the simulated family are what a frozen network cannot know. Whether the training
people are such is decided on rollouts of theirs that fine-tuning did not see.

The study's rollouts lie side by side in a batch, each with its person's style from their *other*
rollouts: what is learned or measured on it holds for rollouts that did not calibrate anyone.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import cos, pi

import numpy as np
import torch

from steerlab.learning.empirical_bayes.grid import GridSeries
from steerlab.learning.pretrained.known_people import known_from_others
from steerlab.learning.pretrained.model import (
    Alignment,
    KnownStyle,
    PretrainedModel,
    ResidualNetwork,
    closed_form,
    network_inputs,
)
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StudyBatch:
    """Rollouts of a study on the grid, padded to one length: (rollouts, samples).

    Attributes:
        label, prediction: bridged labels; the closed form's truth, in units.
        present, valid: there is a label; label and truth may train or score.
        truth: 0 beyond the end.
        motion: (rollouts, samples, 3), or None.
        known: of the person of each rollout, from their other rollouts.
        rollout: name of each.
    """

    label: FloatArray
    prediction: FloatArray
    present: BoolArray
    truth: FloatArray
    valid: BoolArray
    motion: FloatArray | None
    known: KnownStyle
    rollout: tuple[str, ...]


def study_batch(
    model: PretrainedModel,
    series: Sequence[LabelSeries],
    motions: Sequence[FloatArray] | None,
) -> StudyBatch | None:
    """Each rollout with the style of its person found from that person's other rollouts.

    None if nobody has two rollouts.

    Args:
        model: whose encoder finds the styles.
        series: of the training people; someone with a single rollout is left out.
        motions: the car's motion on the grid of each series, or None.
    """
    grids = [GridSeries.from_series(drive) for drive in series]
    found = known_from_others(model, series, motions)
    if found is None:
        return None
    kept, known = found
    samples = max(len(grids[row].label) for row in kept)

    def padded(name: str) -> np.ndarray:
        values = [getattr(grids[row], name) for row in kept]
        return np.stack([np.pad(value, (0, samples - len(value))) for value in values])

    def held(values: FloatArray) -> FloatArray:
        return values[np.minimum(np.arange(samples), len(values) - 1)]

    label = np.stack([held(grids[row].label) for row in kept])
    return StudyBatch(
        label=label,
        prediction=closed_form(label, known.unit, known.coefficients),
        present=padded("present"),
        truth=padded("truth"),
        valid=padded("valid"),
        motion=None if motions is None else np.stack([held(motions[row]) for row in kept]),
        known=known,
        rollout=tuple(series[row].rollout for row in kept),
    )


@dataclass(frozen=True, kw_only=True)
class FineTuningConfig:
    """How far to move the layers that turn w into the network's factors; the rest stays frozen.

    Attributes:
        steps, batch_size, rate: of AdamW with a cosine; few and small, the data are few.
        hold_out_every: every ``hold_out_every``-th training rollout is held out for the choice.
        margin: relative gain on them from which fine-tuning is kept; below it, it is luck.
    """

    steps: int = 80
    batch_size: int = 32
    rate: float = 1e-3
    hold_out_every: int = 4
    margin: float = 0.1


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FineTuned:
    """The result of fine-tuning.

    Attributes:
        network: to use, frozen or fine-tuned.
        gain: relative, on the rollouts held out for the choice; 0 when too few are there.
        unseen: (rollouts,) of the batch, those that ``network`` was not trained on.
    """

    network: ResidualNetwork
    gain: float
    unseen: BoolArray


def fine_tuned(
    model: PretrainedModel,
    batch: StudyBatch,
    seed: int,
    config: FineTuningConfig,
) -> FineTuned:
    """Fine-tune, and keep it if it helps on rollouts held out for the choice."""
    everything = np.ones(len(batch.rollout), dtype=bool)
    names = sorted(set(batch.rollout))
    deciding = names[config.hold_out_every // 2 :: config.hold_out_every]
    held_out = np.isin(batch.rollout, deciding)
    if len(names) < config.hold_out_every or held_out.all():
        return FineTuned(network=model.network, gain=0.0, unseen=everything)
    inputs = _inputs(model, batch)
    with torch_threads(1):
        tuned = _tune(model.network, inputs, batch, np.flatnonzero(~held_out), seed, config)
        before, after = (
            _mean_error(network, inputs, batch, np.flatnonzero(held_out))
            for network in (model.network, tuned)
        )
    gain = 1.0 - after / before
    if gain > config.margin:
        return FineTuned(network=tuned, gain=gain, unseen=held_out)
    return FineTuned(network=model.network, gain=gain, unseen=everything)


def _inputs(model: PretrainedModel, batch: StudyBatch) -> torch.Tensor:
    known = batch.known
    alignment = Alignment.from_style(known.style, model.style_readout)
    return network_inputs(
        batch.label,
        known.unit,
        batch.prediction,
        batch.present,
        known.in_study,
        alignment,
        batch.motion,
    )


def _tune(
    network: ResidualNetwork,
    inputs: torch.Tensor,
    batch: StudyBatch,
    rows: np.ndarray,
    seed: int,
    config: FineTuningConfig,
) -> ResidualNetwork:
    tuned = deepcopy(network).requires_grad_(True)
    # Everyone labels the same few rollouts; free convolutions would learn those by heart.
    adapted = [*tuned.style.parameters(), *tuned.film.parameters()]
    optimizer = torch.optim.AdamW(adapted, lr=config.rate, weight_decay=1e-3)
    rng = np.random.default_rng(seed)
    for step in range(config.steps):
        for group in optimizer.param_groups:
            group["lr"] = config.rate * 0.5 * (1.0 + cos(pi * step / config.steps))
        loss = _loss(tuned, inputs, batch, rng.choice(rows, config.batch_size))
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(adapted, 1.0)
        optimizer.step()
    return tuned.requires_grad_(False)


def _mean_error(
    network: ResidualNetwork, inputs: torch.Tensor, batch: StudyBatch, rows: np.ndarray
) -> float:
    with torch.no_grad():
        return float(_loss(network, inputs, batch, rows))


def _loss(
    network: ResidualNetwork, inputs: torch.Tensor, batch: StudyBatch, rows: np.ndarray
) -> torch.Tensor:
    known = batch.known[rows]
    style = torch.from_numpy(known.style.astype(np.float32))
    correction, _ = network(inputs[rows], style, torch.from_numpy(known.sums[:, 0].copy()))
    truth = batch.truth[rows] / known.unit[:, None]
    residual = torch.from_numpy((batch.prediction[rows, 0] - truth).astype(np.float32))
    valid = torch.from_numpy(batch.valid[rows]).float()
    return ((correction + residual).abs() * valid).sum() / valid.sum()
