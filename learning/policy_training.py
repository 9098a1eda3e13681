"""Training a policy between two rounds: a fixed number of steps from the weights it has."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, isfinite, pi

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from steerlab.learning.adam import Adam
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.learning.training import torch_threads
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.rollout import FloatArray

Progress = Callable[[float], None]


def no_progress(share: float) -> None:
    """Nobody is told how far it is."""


class TrainingDiverged(SteerlabError, ArithmeticError):
    """The loss is not a number any more."""


@dataclass(frozen=True, kw_only=True)
class PolicyTrainingConfig:
    """How a round trains.

    Attributes:
        rate: of Adam, made anew each round; falls to 0 along a cosine within the round.
    """

    steps: int = 150
    batch_size: int = 64
    rate: float = 2e-3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (isfinite(value) and value > 0):
                raise InvalidConfig(f"PolicyTrainingConfig.{name} is {value}; it must be positive.")


@dataclass(frozen=True, slots=True, eq=False)
class TrainingRows:
    """What a policy is to imitate.

    Attributes:
        target: (rows,) wheel positions.
        weight: (rows,) of the squared error, not negative.
    """

    seen: Observations
    target: FloatArray
    weight: FloatArray

    def __post_init__(self) -> None:
        rows = (len(self.seen),)
        if self.target.shape != rows or self.weight.shape != rows or rows == (0,):
            raise InvalidLabels(
                f"{rows[0]} observations, target {self.target.shape} and weight "
                f"{self.weight.shape}; give one of each a row, and at least one row."
            )
        if not (np.isfinite(self.target).all() and np.isfinite(self.weight).all()):
            raise InvalidLabels("A target or weight is not finite; leave such rows out.")


def train_policy(
    network: PolicyNetwork,
    rows: TrainingRows,
    rng: np.random.Generator,
    config: PolicyTrainingConfig,
    progress: Progress = no_progress,
) -> float:
    """Take ``config.steps`` steps of Adam on the weighted mean squared error.

    What is learnt does not depend on the processor.

    Args:
        progress: told the share that is done after each step; what it raises ends the training and
            leaves the network as it was.

    Returns:
        the mean loss of the last tenth of the steps.

    Raises:
        TrainingDiverged: the loss is not finite; the network is then as it was.
    """
    from steerlab.learning.policy_kernels.gradient import ByValues, Rows, batch_gradient
    from steerlab.learning.policy_kernels.layout import room_for, sizes_of
    from steerlab.learning.policy_kernels.products import LANES

    sizes = sizes_of(network.config)
    blocks = -(-config.batch_size // LANES)
    values, by = room_for(sizes, blocks), ByValues.of(sizes, blocks)
    learnt_from = Rows(
        np.ascontiguousarray(rows.seen.image).reshape(len(rows.target), -1),
        np.ascontiguousarray(rows.seen.motion, np.float32),
        rows.target.astype(np.float32),
        rows.weight.astype(np.float32),
    )
    losses = np.empty(config.steps)
    with torch_threads(1), torch.no_grad():
        vector = parameters_to_vector(network.used())
        gradient = torch.empty_like(vector)
        optimiser = Adam({vector: config.rate})
        for step, chosen in enumerate(_batches(len(rows.target), rng, config)):
            loss = batch_gradient(
                sizes, vector.numpy(), learnt_from, chosen, values, by, gradient.numpy()
            )
            if not isfinite(loss):
                raise TrainingDiverged(
                    f"The policy's loss is {loss} at step {step} of {config.steps}; lower the rate "
                    f"({config.rate:g}) or look at the labels."
                )
            losses[step] = loss
            optimiser.step({vector: gradient}, 0.5 * (1.0 + cos(pi * step / config.steps)))
            progress((step + 1) / config.steps)
        if not torch.isfinite(vector).all():
            raise TrainingDiverged(
                f"A weight of the policy is not finite after {config.steps} steps; lower the rate "
                f"({config.rate:g}) or look at the labels."
            )
        vector_to_parameters(vector, network.used())
    return float(losses[-max(1, config.steps // 10) :].mean())


def _batches(
    rows: int, rng: np.random.Generator, config: PolicyTrainingConfig
) -> NDArray[np.int64]:
    """(steps, batch): every row once before any comes twice."""
    wanted = config.steps * config.batch_size
    passes = -(-wanted // rows)
    order = np.concatenate([rng.permutation(rows) for _ in range(passes)])
    return order[:wanted].reshape(config.steps, config.batch_size)
