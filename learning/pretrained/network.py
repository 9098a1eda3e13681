"""The residual network: what it adds to the closed-form prediction, given a person's style."""

from dataclasses import dataclass
from math import sqrt

import torch
from torch import Tensor, nn

from steerlab.sim.errors import InvalidConfig

INPUTS = (
    "label",
    "prediction",
    "at_stop",
    "present",
    "aligned_label",
    "aligned_at_stop",
    "aligned_present",
    "yaw_rate",
    "robot_wheel",
    "context",
)
"""Input channels; the aligned ones are read later by the person's delay and divided by the gain."""

CONTEXT_INPUTS = 3  # the last ones
_PHASES = 2  # two samples at 20 Hz are one position of the network: half the work, same reach


@dataclass(frozen=True, kw_only=True)
class ResidualConfig:
    """Sizes.

    Attributes:
        style_size: entries of w.
        channels: of every convolution.
        dilations: one residual block each, in positions of 0.1 s.
        style_hidden: of the layer between w and the FiLM factors.
    """

    style_size: int
    channels: int = 64
    dilations: tuple[int, ...] = (1, 2, 4, 8, 16)
    style_hidden: int = 48

    def __post_init__(self) -> None:
        object.__setattr__(self, "dilations", tuple(self.dilations))  # from JSON
        sizes = (self.style_size, self.channels, self.style_hidden, *self.dilations)
        if min(sizes) < 1 or not self.dilations:
            raise InvalidConfig(f"{self} has a size below 1 or no block.")


class ResidualNetwork(nn.Module):
    """Dilated residual convolutions with FiLM by w (Perez et al., AAAI 2018).

    Args:
        config: sizes.
        generator: draws the initial weights; torch's global generator is neither read nor moved.
    """

    def __init__(self, config: ResidualConfig, generator: torch.Generator) -> None:
        super().__init__()
        self.config = config
        size = config.channels
        with torch.random.fork_rng(devices=[]):
            self.stem = nn.Conv1d(_PHASES * len(INPUTS), size, 5, padding=2)
            self.blocks = nn.ModuleList(
                nn.Conv1d(size, size, 3, padding=dilation, dilation=dilation)
                for dilation in config.dilations
            )
            self.mixers = nn.ModuleList(nn.Conv1d(size, size, 1) for _ in config.dilations)
            self.style = nn.Linear(config.style_size, config.style_hidden)
            self.film = nn.Linear(config.style_hidden, 2 * size * (len(config.dilations) + 1))
            self.out = nn.Conv1d(size, 2 * _PHASES, 1)
        with torch.no_grad():  # torch's default scheme, from our generator
            for module in self.modules():
                if isinstance(module, nn.Conv1d | nn.Linear):
                    bound = 1.0 / sqrt(module.weight[0].numel())
                    for parameter in module.parameters():
                        parameter.uniform_(-bound, bound, generator=generator)
            for parameter in (*self.film.parameters(), *self.out.parameters()):
                parameter.mul_(0.1)  # starts close to the closed-form prediction

    def forward(self, inputs: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
        """Inputs (batch, samples, channels), style (batch, w) -> correction, log spread.

        Both (batch, samples): what to add to the prediction, and the log of the mean absolute
        error that remains. An odd number of samples is filled up with an absent one.
        """
        batch, samples, channels = inputs.shape
        if samples % _PHASES:
            inputs = torch.cat([inputs, inputs.new_zeros(batch, 1, channels)], dim=1)
        folded = inputs.reshape(batch, -1, _PHASES * channels).transpose(1, 2)
        factors = self.film(torch.nn.functional.silu(self.style(style)))
        factors = factors.reshape(batch, len(self.blocks) + 1, 2, -1, 1)
        hidden = self.stem(folded)
        hidden = torch.relu(hidden * (1.0 + factors[:, 0, 0]) + factors[:, 0, 1])
        for number, (block, mixer) in enumerate(zip(self.blocks, self.mixers, strict=True), 1):
            inner = block(hidden) * (1.0 + factors[:, number, 0]) + factors[:, number, 1]
            hidden = hidden + mixer(torch.relu(inner))
        out = self.out(torch.relu(hidden)).transpose(1, 2)
        correction, log_spread = out.reshape(batch, -1, _PHASES, 2).unbind(-1)
        return (
            correction.reshape(batch, -1)[:, :samples],
            log_spread.reshape(batch, -1)[:, :samples],
        )
