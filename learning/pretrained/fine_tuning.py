"""Fine-tune the shipped network on a study's own training people, and keep it only if it helps.

Teachers outside the simulated family are what a frozen network cannot know. Whether the training
people are such is decided on rollouts of theirs that fine-tuning did not see.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import cos, pi

import numpy as np
import torch

from steerlab.learning.empirical_bayes.grid import GridSeries
from steerlab.learning.pretrained.model import (
    Alignment,
    PretrainedModel,
    closed_form,
    network_inputs,
)
from steerlab.learning.pretrained.network import ResidualNetwork
from steerlab.learning.pretrained.style import StyleMoments, concatenate, style_moments
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads
from steerlab.sim.rollout import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class FineTuningConfig:
    """How far to move the layers that turn w into the network's factors; the rest stays frozen.

    Attributes:
        steps, batch_size, rate: of AdamW with a cosine; few and small, the data are few.
        hold_out_every: of the training rollouts, every so many-th decides.
        margin: relative gain on them from which fine-tuning is kept; below it, it is luck.
    """

    steps: int = 80
    batch_size: int = 32
    rate: float = 1e-3
    hold_out_every: int = 4
    margin: float = 0.01


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StudyBatch:
    """Rollouts of a study, ready for the network; padded to one length, (rollouts, samples)."""

    inputs: torch.Tensor
    prediction: FloatArray
    truth: FloatArray
    valid: BoolArray
    style: FloatArray
    rollout: tuple[str, ...]


def study_batch(
    model: PretrainedModel, series: Sequence[LabelSeries], motions: Sequence[FloatArray] | None
) -> StudyBatch | None:
    """Each rollout with the style of its person found from that person's *other* rollouts.

    None if nobody has two rollouts.

    Args:
        model: whose encoder finds the styles.
        series: of the training people; someone with a single rollout is left out.
        motions: the car's motion on the grid of each series, or None.
    """
    grids = [GridSeries.from_series(one) for one in series]
    parts = [style_moments(one.label[None], one.truth[None], one.valid[None]) for one in grids]
    moments = concatenate(parts)
    person = np.array([one.person for one in series])
    others = (person[:, None] == person) & ~np.eye(len(series), dtype=bool)
    kept = [row for row in range(len(series)) if (others[row] @ moments.inverse.rows) > 0.0]
    if not kept:
        return None
    coefficients, style = model.encoder(_grouped(moments, others[kept]))
    samples = max(len(grids[row].label) for row in kept)

    def padded(name: str) -> np.ndarray:
        values = [getattr(grids[row], name) for row in kept]
        return np.stack([np.pad(one, (0, samples - len(one))) for one in values])

    def held(values: FloatArray) -> FloatArray:
        return values[np.minimum(np.arange(samples), len(values) - 1)]

    label = np.stack([held(grids[row].label) for row in kept])
    motion = None if motions is None else np.stack([held(motions[row]) for row in kept])
    prediction = closed_form(label, coefficients)
    alignment = Alignment.from_style(style, model.style_readout)
    return StudyBatch(
        inputs=network_inputs(label, prediction, padded("present"), alignment, motion),
        prediction=prediction,
        truth=padded("truth"),
        valid=padded("valid"),
        style=style,
        rollout=tuple(series[row].rollout for row in kept),
    )


def fine_tuned(
    model: PretrainedModel,
    batch: StudyBatch | None,
    seed: int,
    config: FineTuningConfig,
) -> tuple[ResidualNetwork, float]:
    """The network to use, frozen or fine-tuned, and the relative gain on held-out rollouts.

    The gain is 0 when too few rollouts are there to decide.
    """
    if batch is None:
        return model.network, 0.0
    names = sorted(set(batch.rollout))
    deciding = names[config.hold_out_every // 2 :: config.hold_out_every]
    held_out = np.isin(batch.rollout, deciding)
    if len(names) < config.hold_out_every or held_out.all():
        return model.network, 0.0
    with torch_threads(1):
        tuned = _tune(model.network, batch, np.flatnonzero(~held_out), seed, config)
        before, after = (
            _mean_error(network, batch, np.flatnonzero(held_out))
            for network in (model.network, tuned)
        )
    gain = 1.0 - after / before
    return (tuned, gain) if gain > config.margin else (model.network, gain)


def _tune(
    network: ResidualNetwork,
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
        loss = _loss(tuned, batch, rng.choice(rows, config.batch_size))
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(adapted, 1.0)
        optimizer.step()
    return tuned.requires_grad_(False)


def _mean_error(network: ResidualNetwork, batch: StudyBatch, rows: np.ndarray) -> float:
    with torch.no_grad():
        return float(_loss(network, batch, rows))


def _loss(network: ResidualNetwork, batch: StudyBatch, rows: np.ndarray) -> torch.Tensor:
    style = torch.from_numpy(batch.style[rows].astype(np.float32))
    correction, _ = network(batch.inputs[rows], style)
    residual = torch.from_numpy((batch.prediction - batch.truth)[rows].astype(np.float32))
    valid = torch.from_numpy(batch.valid[rows]).float()
    return ((correction + residual).abs() * valid).sum() / valid.sum()


def _grouped(moments: StyleMoments, weights: BoolArray) -> StyleMoments:
    return moments.grouped(weights.astype(np.float64))
