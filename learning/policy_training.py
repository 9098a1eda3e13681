"""Training a policy between two rounds: a fixed number of steps from the weights it has."""

from copy import deepcopy
from dataclasses import dataclass
from math import cos, isfinite, pi

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.progress import ShareProgress, no_progress


class TrainingDiverged(SteerlabError, ArithmeticError):
    """The loss or a weight became NaN or infinite."""


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
    """Observations, and the wheel a policy should learn to give for each.

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
    progress: ShareProgress = no_progress,
) -> float:
    """Take ``config.steps`` steps of Adam on the weighted mean squared error.

    The same ``rng`` gives the same bits on the same machine; other processors round otherwise.

    Args:
        progress: told the share that is done after each step; what it raises ends the training and
            leaves the network as it was.

    Returns:
        the mean loss of the last tenth of the steps.

    Raises:
        TrainingDiverged: the loss is not finite; the network is then as it was.
    """
    image, motion = torch.from_numpy(rows.seen.image), torch.from_numpy(rows.seen.motion)
    target, weight = (torch.from_numpy(values).float() for values in (rows.target, rows.weight))
    trained = deepcopy(network)
    optimiser = torch.optim.Adam(trained.parameters(), lr=config.rate, fused=True)
    losses = np.empty(config.steps)
    with torch_threads(1):
        for step, batch in enumerate(_batches(len(target), rng, config)):
            error = trained(image[batch], motion[batch]) - target[batch]
            loss = (weight[batch] * error.square()).mean()
            losses[step] = loss.item()
            if not isfinite(losses[step]):
                raise TrainingDiverged(
                    f"The policy's loss is {losses[step]} at step {step} of {config.steps}; lower "
                    f"the rate ({config.rate:g}) or look at the labels."
                )
            for group in optimiser.param_groups:
                group["lr"] = config.rate * 0.5 * (1.0 + cos(pi * step / config.steps))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            progress((step + 1) / config.steps)
    if not all(torch.isfinite(weights).all() for weights in trained.parameters()):
        raise TrainingDiverged(
            f"A weight of the policy is not finite after {config.steps} steps; lower the rate "
            f"({config.rate:g}) or look at the labels."
        )
    network.load_state_dict(trained.state_dict())
    return float(losses[-max(1, config.steps // 10) :].mean())


def _batches(
    rows: int, rng: np.random.Generator, config: PolicyTrainingConfig
) -> tuple[Tensor, ...]:
    """``config.steps`` times (batch,): every row once before any comes twice."""
    wanted = config.steps * config.batch_size
    passes = -(-wanted // rows)
    order = np.concatenate([rng.permutation(rows) for _ in range(passes)])
    return torch.from_numpy(order[:wanted]).split(config.batch_size)
