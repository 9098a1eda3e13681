"""``PretrainedModel``: style encoder and residual network together, and how they map labels."""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from steerlab.learning.empirical_bayes.grid import RATE_HZ, at_stop, label_features
from steerlab.learning.pretrained.style import StyleEncoder, mirrored_style
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

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
_MOST_DILATION = 1024  # positions; as much is added on either side of a drive
DELAY_RANGE_S = (-0.8, 1.3)  # of what was simulated
LOG_GAIN_RANGE = (-1.3, 1.3)
MIRROR_OF_MOTION = np.array([-1.0, 1.0, -1.0])  # yaw rate, speed, robot wheel
YAW_RATE_SCALE = 0.5  # rad/s; brings the car's turning to the size of a label


@dataclass(frozen=True, kw_only=True)
class ResidualConfig:
    """Sizes of the residual network.

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
        if max(self.dilations) > _MOST_DILATION:
            raise InvalidConfig(
                f"{self} has a dilation above {_MOST_DILATION}; give a smaller one."
            )


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


@dataclass(frozen=True, slots=True, eq=False)
class PretrainedModel:
    """The result of pre-training.

    Attributes:
        encoder: calibration labels to coefficients and w.
        network: corrects the closed-form prediction.
        style_readout: (1 + STYLE_SIZE, parameters) from w to ``teachers.STYLE``, least squares.
        seed: it was made from.
    """

    encoder: StyleEncoder
    network: ResidualNetwork
    style_readout: FloatArray
    seed: int


def closed_form(label: NDArray[Any], coefficients: FloatArray) -> FloatArray:
    """The inverse model's truth: label (batch, samples), coefficients (batch, features)."""
    predicted = np.einsum("bsf,bf->bs", label_features(label), coefficients)
    return np.clip(predicted, -WHEEL_LIMIT, WHEEL_LIMIT)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Alignment:
    """How to bring labels to the time and size of the truth, roughly; (batch,) each."""

    delay_s: FloatArray
    gain: FloatArray
    bias: FloatArray

    @classmethod
    def from_style(cls, style: FloatArray, readout: FloatArray) -> "Alignment":
        """The alignment for w (batch, STYLE_SIZE), by the readout (1 + STYLE_SIZE, parameters)."""
        values = dict(zip(STYLE, (readout[0] + style @ readout[1:]).T, strict=True))
        return cls(
            delay_s=np.clip(values["delay_s"] + values["lag_s"], *DELAY_RANGE_S),
            gain=np.exp(np.clip(values["log_gain"], *LOG_GAIN_RANGE)),
            bias=values["bias"],
        )


def network_inputs(
    label: NDArray[Any],
    prediction: FloatArray,
    present: BoolArray,
    alignment: Alignment,
    motion: NDArray[Any] | None,
) -> Tensor:
    """Input channels: all (batch, samples), motion (batch, samples, 3) or None -> (.., channels).

    Args:
        motion: yaw rate, speed and robot wheel; without it the context channels are 0.
    """
    channels = np.zeros((*label.shape, len(INPUTS)), dtype=np.float32)
    stop = np.sign(label) * at_stop(label)
    held = present.astype(np.float64)
    channels[..., 0] = label
    channels[..., 1] = prediction
    channels[..., 2] = stop
    channels[..., 3] = 1.0
    channels[~present] = 0.0
    unbiased = (label - alignment.bias[:, None]) / alignment.gain[:, None]
    samples = label.shape[1]
    position = np.arange(samples) + alignment.delay_s[:, None] * RATE_HZ
    inside = (position >= 0.0) & (position <= samples - 1.0)
    position = np.clip(position, 0.0, samples - 1.0)
    below = np.minimum(position.astype(np.int64), max(samples - 2, 0))
    weight = position - below
    above = np.minimum(below + 1, samples - 1)
    rows = np.arange(len(label))[:, None]
    for channel, values in ((4, unbiased), (5, stop), (6, held)):
        channels[..., channel] = inside * (
            (1.0 - weight) * values[rows, below] + weight * values[rows, above]
        )
    channels[..., 4:6] *= channels[..., 6:7] > 0.99
    if motion is not None:
        channels[..., -3] = motion[..., 0] / YAW_RATE_SCALE
        channels[..., -2] = motion[..., 2]
        channels[..., -1] = 1.0
    return torch.from_numpy(channels)


def map_labels(
    network: ResidualNetwork,
    readout: FloatArray,
    coefficients: FloatArray,
    style: FloatArray,
    label: FloatArray,
    present: BoolArray,
    motion: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Mapped labels and their expected absolute error, (batch, samples) each.

    Averaged over the labels and their mirror image, so left and right are treated exactly alike.

    Args:
        network: frozen or fine-tuned.
        readout: see ``PretrainedModel.style_readout``.
        coefficients: (batch, features).
        style: (batch, STYLE_SIZE).
        label: (batch, samples), bridged.
        present: (batch, samples).
        motion: (batch, samples, 3) or None.
    """
    prediction = closed_form(label, coefficients)
    mirrored_motion = None if motion is None else motion * MIRROR_OF_MOTION
    corrections: list[FloatArray] = []
    log_spreads: list[FloatArray] = []
    for sign, w, moved in (
        (1.0, style, motion),
        (-1.0, mirrored_style(style), mirrored_motion),
    ):
        alignment = Alignment.from_style(w, readout)
        inputs = network_inputs(sign * label, sign * prediction, present, alignment, moved)
        with torch.no_grad():
            correction, log_spread = network(inputs, torch.from_numpy(w.astype(np.float32)))
        corrections.append(sign * correction.double().numpy())
        log_spreads.append(log_spread.double().numpy())
    mapped = prediction + np.mean(corrections, axis=0)
    return np.clip(mapped, -WHEEL_LIMIT, WHEEL_LIMIT), np.exp(np.mean(log_spreads, axis=0))
