"""Training a policy between two rounds: a fixed number of steps from the weights it has."""

from dataclasses import dataclass
from math import cos, isfinite, pi

import numpy as np
import torch
from numpy.typing import NDArray

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.learning.training import torch_threads
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.rollout import FloatArray


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
) -> float:
    """Take ``config.steps`` steps of Adam on the weighted mean squared error.

    Returns:
        the mean loss of the last tenth of the steps.

    Raises:
        TrainingDiverged: the loss is not finite; the network is then of no use.
    """
    image, motion = torch.from_numpy(rows.seen.image), torch.from_numpy(rows.seen.motion)
    target = torch.from_numpy(rows.target.astype(np.float32))
    weight = torch.from_numpy(rows.weight.astype(np.float32))
    optimiser = torch.optim.Adam(network.parameters(), lr=config.rate, fused=True)
    chosen = _batches(len(rows.target), rng, config)
    last: list[float] = []
    with torch_threads(1):  # two threads give other bits, and so another policy
        for step in range(config.steps):
            batch = torch.from_numpy(chosen[step])
            for group in optimiser.param_groups:  # a scheduler object costs as much as the step
                group["lr"] = config.rate * 0.5 * (1.0 + cos(pi * step / config.steps))
            error = network(image[batch], motion[batch]) - target[batch]
            loss = (weight[batch] * error.square()).mean()
            if step >= 0.9 * config.steps or step % 25 == 0:
                last.append(float(loss.detach()))
                if not isfinite(last[-1]):
                    raise TrainingDiverged(
                        f"The policy's loss is {last[-1]} at step {step} of {config.steps}; lower "
                        f"the rate ({config.rate:g}) or look at the labels."
                    )
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
    return float(np.mean(last[-max(1, config.steps // 10) :]))


def _batches(
    rows: int, rng: np.random.Generator, config: PolicyTrainingConfig
) -> NDArray[np.int64]:
    """(steps, batch): every row once before any comes twice."""
    wanted = config.steps * config.batch_size
    passes = -(-wanted // rows)
    order = np.concatenate([rng.permutation(rows) for _ in range(passes)])
    return order[:wanted].reshape(config.steps, config.batch_size)
