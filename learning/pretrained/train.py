"""Make the shipped weights: ``python -m steerlab.learning.pretrained.train --seed 0 --out FILE``.

Drives the wizard in new worlds, simulates teachers who label the drives, learns the priors in
closed form and then the network. Same seed, same machine, same number of BLAS threads
(``OMP_NUM_THREADS``; the shipped file was made with two): same bytes.
"""

import argparse
import logging
from dataclasses import dataclass, field
from math import cos, isfinite, pi
from pathlib import Path

import numpy as np
import torch

from steerlab.learning.empirical_bayes.grid import RATE_HZ
from steerlab.learning.pretrained.drives import generate_drives
from steerlab.learning.pretrained.model import (
    CONTEXT_INPUTS,
    Alignment,
    PretrainedModel,
    ResidualConfig,
    ResidualNetwork,
    closed_form,
    network_inputs,
)
from steerlab.learning.pretrained.style import (
    STYLE_SIZE,
    StyleEncoder,
    StyleMoments,
    concatenate,
    style_moments,
)
from steerlab.learning.pretrained.teachers import (
    PretrainingDrive,
    SimulatedStudy,
    TeacherRanges,
    known_readout,
    known_style,
    simulate_study,
)
from steerlab.learning.pretrained.weights import save_model
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.progress import Progress

_AT_ONCE = 100  # people whose features are held at once
_SPREAD_WEIGHT = 0.1  # the spread must not steer the correction


@dataclass(frozen=True, kw_only=True)
class PretrainConfig:
    """Sizes of simulation and training; the defaults made the shipped weights.

    Attributes:
        people, rollouts: simulated teachers, and drives that each labels.
        steps, batch_size: of training the network; a batch holds that many crops.
        crop: samples of a crop; its ends are trained like the ends of a rollout.
        context_share: share of crops that show the car's motion.
        known_style: tell the network the teachers' true parameters, for ``ceiling.py``.
    """

    worlds: int = 60
    drives_per_world: int = 8
    people: int = 3000
    rollouts: int = 10
    steps: int = 10_000
    batch_size: int = 96
    crop: int = 160
    rate: float = 4e-3
    context_share: float = 0.5
    known_style: bool = False
    network: ResidualConfig = field(default_factory=lambda: ResidualConfig(style_size=STYLE_SIZE))
    ranges: TeacherRanges = field(default_factory=TeacherRanges)

    def __post_init__(self) -> None:
        for name in ("people", "rollouts", "steps", "batch_size", "crop", "rate"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise InvalidConfig(f"PretrainConfig.{name} is {value}; it must be positive.")
        if self.rollouts < 2 or self.people < 2:
            raise InvalidConfig(
                f"{self.people} people with {self.rollouts} rollouts cannot be held apart; "
                "give at least two of each."
            )


@dataclass(frozen=True, slots=True, eq=False)
class _StyleTable:
    """For each (person, rollout): coefficients and w found from a few of the *other* rollouts."""

    coefficients: FloatArray
    style: FloatArray


def pretrain(
    seed: int,
    config: PretrainConfig | None = None,
    *,
    drives: list[PretrainingDrive] | None = None,
    progress: Progress | None = None,
) -> PretrainedModel:
    """Simulate teachers and train the model on them.

    Args:
        seed: of worlds, drives, teachers, weights and batches.
        config: how much.
        drives: in place of those that ``seed`` gives.
        progress: told what is being done and which share of it is.
    """
    config, tell = config or PretrainConfig(), progress or (lambda what, share: None)
    if drives is None:
        drives = generate_drives(
            seed,
            config.worlds,
            config.drives_per_world,
            lambda done, worlds: tell("driving in new worlds", done / worlds),
        )
    rng = np.random.default_rng([seed, 1])
    tell("simulating teachers", 0.0)
    study = simulate_study(drives, config.people, config.rollouts, RATE_HZ, rng, config.ranges)
    moments = _moments(study)
    encoder = StyleEncoder.fit(moments.summed(config.people))
    tables = [_style_table(encoder, moments, study, rng) for _ in range(2)]
    tell("simulating teachers", 1.0)
    target = np.repeat(study.style[:, None], config.rollouts, axis=1)
    if config.known_style:
        tables = [_StyleTable(table.coefficients, known_style(target)) for table in tables]
        readout = known_readout()
    else:
        styles = _flat(tables[0].style)
        design = np.column_stack([np.ones(len(styles)), styles])
        readout = np.linalg.lstsq(design, _flat(target), rcond=None)[0].astype(np.float64)
    with torch_threads(1):
        network = _train_network(study, tables, readout, config, seed, rng, tell)
    return PretrainedModel(encoder=encoder, network=network, style_readout=readout, seed=seed)


def _moments(study: SimulatedStudy) -> StyleMoments:
    """Moments of every rollout of every person, (people * rollouts, ...)."""
    label, truth = study.label.astype(np.float64), study.truth.astype(np.float64)
    return concatenate(
        [
            style_moments(_flat(label[people]), _flat(truth[people]), _flat(study.present[people]))
            for people in np.array_split(np.arange(len(label)), -(-len(label) // _AT_ONCE))
        ]
    )


def _style_table(
    encoder: StyleEncoder, moments: StyleMoments, study: SimulatedStudy, rng: np.random.Generator
) -> _StyleTable:
    people, rollouts = study.label.shape[:2]
    coefficients, styles = [], []
    for chunk in np.array_split(np.arange(people), -(-people // _AT_ONCE)):
        weights = np.zeros((len(chunk), rollouts, rollouts))
        subsets: list[StyleMoments] = []
        for target in range(rollouts):  # the rollout to map never calibrates itself
            others = np.delete(np.arange(rollouts), target)
            rank = rng.random((len(chunk), rollouts - 1)).argsort(axis=1)
            weights[:, target, others] = rank < rng.integers(1, rollouts, (len(chunk), 1))
        for index, person in enumerate(chunk):
            rows = slice(person * rollouts, (person + 1) * rollouts)
            subsets.append(moments[rows].grouped(weights[index]))
        chunk_coefficients, chunk_styles = encoder(concatenate(subsets))
        coefficients.append(chunk_coefficients)
        styles.append(chunk_styles)
    shape = (people, rollouts, -1)
    return _StyleTable(
        np.concatenate(coefficients).reshape(shape), np.concatenate(styles).reshape(shape)
    )


def _train_network(
    study: SimulatedStudy,
    tables: list[_StyleTable],
    readout: FloatArray,
    config: PretrainConfig,
    seed: int,
    rng: np.random.Generator,
    tell: Progress,
) -> ResidualNetwork:
    generator = torch.Generator().manual_seed(seed)
    network = ResidualNetwork(config.network, generator)
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda step: _rate_factor(step, config.steps)
    )
    people, rollouts, samples = study.label.shape
    lengths = study.present.sum(axis=-1)
    span = np.arange(config.crop)
    for step in range(config.steps):
        person = rng.integers(people, size=config.batch_size)[:, None]
        rollout = rng.integers(rollouts, size=config.batch_size)[:, None]
        latest = np.maximum(lengths[person, rollout] - config.crop, 0)
        at = np.minimum(rng.integers(latest + 1) + span, samples - 1)
        table = tables[int(rng.integers(len(tables)))]
        style = table.style[person[:, 0], rollout[:, 0]]
        alignment = Alignment.from_style(style, readout)
        label = study.label[person, rollout, at]
        prediction = closed_form(label, table.coefficients[person[:, 0], rollout[:, 0]])
        motion = study.motion[person, rollout, at]
        present = study.present[person, rollout, at]
        inputs = network_inputs(label, prediction, present, alignment, motion)
        shown = torch.from_numpy(rng.random(config.batch_size) < config.context_share)
        inputs[..., -CONTEXT_INPUTS:] *= shown[:, None, None]
        truth = torch.from_numpy(study.truth[person, rollout, at])
        kept = torch.from_numpy(present).float()
        correction, log_spread = network(inputs, torch.from_numpy(style.astype(np.float32)))
        mapped = torch.from_numpy(prediction.astype(np.float32)) + correction
        error = (mapped - truth).abs()  # the measure that is reported, so no square
        spread = error.detach() * torch.exp(-log_spread) + log_spread
        loss = ((error + _SPREAD_WEIGHT * spread) * kept).sum() / kept.sum()
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        if (step + 1) % 50 == 0:
            tell("training the network", (step + 1) / config.steps)
    return network.requires_grad_(False)


def _rate_factor(step: int, steps: int) -> float:
    warm_up = min(1.0, (step + 1) / (0.03 * steps + 1))
    return warm_up * 0.5 * (1.0 + cos(pi * step / steps))


def _flat(values: np.ndarray) -> np.ndarray:
    """(people, rollouts, ...) -> (people * rollouts, ...)."""
    return values.reshape(-1, *values.shape[2:])


def main(arguments: list[str] | None = None) -> None:
    """Write a weights file; progress goes to the log."""
    parser = argparse.ArgumentParser(description="Make the weights of sim_pretrained again.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    log = logging.getLogger(__name__)
    log.setLevel(logging.INFO)  # MuJoCo's packages have set the root to warnings by now
    model = pretrain(
        options.seed, progress=lambda what, share: log.info("%s: %.0f %%", what, 100.0 * share)
    )
    save_model(model, options.out)


if __name__ == "__main__":
    main()
