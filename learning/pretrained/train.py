"""Make the shipped weights: ``python -m steerlab.learning.pretrained.train --seed 0 --out FILE``.

Drives the wizard in new worlds, simulates teachers who label the drives, learns the priors in
closed form and then the network. Same seed, same machine, same number of BLAS threads
(``OMP_NUM_THREADS``; the shipped file was made with one): same bytes.
"""

import argparse
import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, isfinite, pi
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from steerlab.learning.empirical_bayes.gaussian import Prior, posterior
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
    shown_inputs,
)
from steerlab.learning.pretrained.style import (
    STYLE_SIZE,
    StyleEncoder,
    StyleMoments,
    concatenate,
    study_prior,
    style_moments,
)
from steerlab.learning.pretrained.teachers import (
    PretrainingDrive,
    SimulatedStudy,
    TeacherRanges,
    simulate_study,
)
from steerlab.learning.pretrained.weights import save_model
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.progress import Progress

_AT_ONCE = 100  # people whose features are held at once
_SIMULATED_AT_ONCE = 512
_SPREAD_WEIGHT = 0.1  # the spread must not steer the correction
_EASIEST = 0.15  # units: people with smaller errors count as if theirs were that


@dataclass(frozen=True, kw_only=True)
class PretrainConfig:
    """Sizes of simulation and training; the defaults made the shipped weights.

    Attributes:
        people, rollouts: simulated teachers, and rollouts that each labels.
        steps, batch_size: of training the network; a batch holds that many crops.
        crop: samples of a crop; its ends are trained like the ends of a rollout.
        shown: crops of calibration rollouts that the set encoder is shown beside each.
        context_share: share of crops that show the car's motion.
        in_study_share: share of crops whose person comes with a study.
    """

    worlds: int = 60
    drives_per_world: int = 8
    people: int = 6144
    rollouts: int = 10
    steps: int = 18_000
    batch_size: int = 96
    crop: int = 160
    shown: int = 3
    rate: float = 4e-3
    context_share: float = 0.5
    in_study_share: float = 0.7
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
    """For each (person, rollout): coefficients and w found from a few of the *other* rollouts.

    Attributes:
        coefficients: (people, rollouts, 2, features), with the prior of the other half of their
            study, and with ours.
        others: (people, rollouts, rollouts) which ones.
    """

    coefficients: NDArray[np.float32]
    style: NDArray[np.float32]
    others: BoolArray


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
    study = _simulated(drives, config, rng, tell)
    moments = _moments(study)
    encoder = StyleEncoder.fit(moments.summed(config.people))
    priors = _study_priors(moments.summed(config.people), config.ranges.study_size, rng)
    tables = [_style_table(encoder, priors, moments, study, rng) for _ in range(2)]
    tell("simulating teachers", 1.0)
    target = np.repeat(study.style[:, None], config.rollouts, axis=1)
    styles = _flat(tables[0].style)
    design = np.column_stack([np.ones(len(styles)), styles])
    readout = np.linalg.lstsq(design, _flat(target), rcond=None)[0].astype(np.float64)
    with torch_threads(1):
        network = _train_network(study, tables, readout, config, seed, rng, tell)
    return PretrainedModel(encoder=encoder, network=network, style_readout=readout, seed=seed)


def _simulated(
    drives: list[PretrainingDrive],
    config: PretrainConfig,
    rng: np.random.Generator,
    tell: Progress,
) -> SimulatedStudy:
    """Everyone, a few at a time: what is in between takes twenty times the memory."""
    parts: list[SimulatedStudy] = []
    groups = -(-config.people // _SIMULATED_AT_ONCE)
    for group in np.array_split(np.arange(config.people), groups):
        tell("simulating teachers", group[0] / config.people)
        parts.append(
            simulate_study(drives, len(group), config.rollouts, RATE_HZ, rng, config.ranges)
        )
    return SimulatedStudy(
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("label", "truth", "motion", "present", "style", "unit")
        }
    )


def _moments(study: SimulatedStudy) -> StyleMoments:
    """Moments of every rollout of every person, (people * rollouts, ...)."""
    rollouts = study.label.shape[1]
    return concatenate(
        [
            style_moments(
                _flat(study.label[people]).astype(np.float64),
                _flat(study.truth[people]).astype(np.float64),
                _flat(study.present[people]),
                np.repeat(study.unit[people], rollouts),
            )
            for people in np.array_split(
                np.arange(len(study.label)), -(-len(study.label) // _AT_ONCE)
            )
        ]
    )


def _study_priors(people: StyleMoments, size: int, rng: np.random.Generator) -> list[Prior]:
    """For each person the prior of some of the other half of their study."""
    count, half = len(people.unit), size // 2
    priors: list[Prior] = []
    for first in range(0, count, half):
        study = first - first % size
        others = np.arange(study, min(study + size, count))
        others = others[(others < first) | (others >= first + half)]
        if len(others) < 2:
            others = np.arange(max(0, count - size), count - half)
        some = rng.permutation(others)[: rng.integers(min(3, len(others)), len(others) + 1)]
        prior = study_prior(people[some.tolist()])
        priors += [prior] * len(range(first, min(first + half, count)))
    return priors


def _style_table(
    encoder: StyleEncoder,
    priors: Sequence[Prior],
    moments: StyleMoments,
    study: SimulatedStudy,
    rng: np.random.Generator,
) -> _StyleTable:
    people, rollouts = study.label.shape[:2]
    coefficients, styles, chosen = [], [], []
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
        together = concatenate(subsets)
        own, chunk_styles = encoder(together)
        in_study = [
            posterior(subset.inverse, priors[person]).mean
            for subset, person in zip(subsets, chunk, strict=True)
        ]
        both = np.stack([np.concatenate(in_study), own], axis=1)
        coefficients.append(both.astype(np.float32))
        styles.append(chunk_styles.astype(np.float32))
        chosen.append(weights > 0.0)
    shape = (people, rollouts, -1)
    return _StyleTable(
        np.concatenate(coefficients).reshape(people, rollouts, 2, -1),
        np.concatenate(styles).reshape(shape),
        np.concatenate(chosen),
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
    people, rollouts = study.label.shape[:2]
    raw = np.abs(study.label - study.truth).mean(axis=(1, 2)) / study.unit
    weight = (1.0 / np.maximum(raw, _EASIEST)).astype(np.float32)
    weight /= weight.mean()
    for step in range(config.steps):
        person = rng.integers(people, size=config.batch_size)
        rollout = rng.integers(rollouts, size=config.batch_size)
        table = tables[int(rng.integers(len(tables)))]
        unit = study.unit[person]
        with_motion = rng.random(config.batch_size) < config.context_share
        shown = torch.from_numpy(with_motion.astype(np.float32))
        sums = network.shown_sums(
            _shown(study, table.others[person, rollout], person, config, rng, with_motion)
        )
        sums = sums.reshape(config.batch_size, config.shown, -1).sum(1)
        style = table.style[person, rollout]
        label, truth, motion, present = _crops(study, person, rollout, config.crop, rng)
        coefficients = table.coefficients[person, rollout].astype(np.float64)
        in_study = rng.random(config.batch_size) < config.in_study_share
        coefficients[~in_study, 0] = coefficients[~in_study, 1]
        prediction = closed_form(label, unit, coefficients)
        alignment = Alignment.from_style(style.astype(np.float64), readout)
        inputs = network_inputs(label, unit, prediction, present, in_study, alignment, motion)
        inputs[..., -CONTEXT_INPUTS:] *= shown[:, None, None]
        wanted = torch.from_numpy((truth / unit[:, None]).astype(np.float32))
        kept = torch.from_numpy(present).float() * torch.from_numpy(weight[person])[:, None]
        correction, log_spread = network(inputs, torch.from_numpy(style), sums)
        mapped = torch.from_numpy(prediction[:, 0].astype(np.float32)) + correction
        error = (mapped - wanted).abs()  # the measure that is reported, so no square
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


def _crops(
    study: SimulatedStudy,
    person: NDArray[np.int64],
    rollout: NDArray[np.int64],
    crop: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Label, truth, motion and presence of a random part of each; (batch, crop, ...)."""
    samples = study.label.shape[-1]
    who, which = person[:, None], rollout[:, None]
    latest = np.maximum(study.present[person, rollout].sum(axis=-1) - crop, 0)[:, None]
    at = np.minimum(rng.integers(latest + 1) + np.arange(crop), samples - 1)
    return (
        study.label[who, which, at].astype(np.float64),
        study.truth[who, which, at].astype(np.float64),
        study.motion[who, which, at].astype(np.float64),
        study.present[who, which, at],
    )


def _shown(
    study: SimulatedStudy,
    others: BoolArray,
    person: NDArray[np.int64],
    config: PretrainConfig,
    rng: np.random.Generator,
    with_motion: BoolArray,
) -> Tensor:
    """Crops of calibration rollouts for the set encoder: (batch * shown, crop, channels)."""
    rank = rng.random((len(person), config.shown, others.shape[1])) * others[:, None]
    rollout, who = rank.argmax(axis=-1).ravel(), person.repeat(config.shown)
    label, truth, motion, present = _crops(study, who, rollout, config.crop, rng)
    motion[~with_motion.repeat(config.shown)] = 0.0
    inputs = shown_inputs(label, truth, present, study.unit[who], motion)
    inputs[..., -1] *= torch.from_numpy(with_motion.repeat(config.shown))[:, None]
    return inputs


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
