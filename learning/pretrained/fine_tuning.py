"""Fine-tune the shipped network on a study's own training people, and keep it only if it helps.

Teachers outside the simulated family are what a frozen network cannot know. Whether the training
people are such is decided on rollouts of theirs that fine-tuning did not see.
"""

from copy import deepcopy
from dataclasses import dataclass
from math import cos, pi

import numpy as np
import torch

from steerlab.learning.pretrained.model import Alignment, PretrainedModel, network_inputs
from steerlab.learning.pretrained.network import ResidualNetwork
from steerlab.learning.pretrained.study_batch import StudyBatch
from steerlab.learning.training import torch_threads
from steerlab.sim.rollout import BoolArray


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
class FineTuned:
    """What fine-tuning came to.

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
    alignment = Alignment.from_style(batch.style, model.style_readout)
    return network_inputs(batch.label, batch.prediction, batch.present, alignment, batch.motion)


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
    style = torch.from_numpy(batch.style[rows].astype(np.float32))
    correction, _ = network(inputs[rows], style)
    residual = torch.from_numpy((batch.prediction - batch.truth)[rows].astype(np.float32))
    valid = torch.from_numpy(batch.valid[rows]).float()
    return ((correction + residual).abs() * valid).sum() / valid.sum()
