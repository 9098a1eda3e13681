"""``PretrainedModel``: style encoder, set encoder and residual network, and how they map labels."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import sqrt
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from steerlab.learning.empirical_bayes.grid import RATE_HZ, at_stop
from steerlab.learning.pretrained.style import (
    StyleEncoder,
    inverse_features,
    mirrored_style,
)
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

INPUTS = (
    "label",
    "prediction",
    "own_prediction",
    "at_stop",
    "present",
    "in_study",
    "aligned_label",
    "aligned_at_stop",
    "aligned_present",
    "yaw_rate",
    "robot_wheel",
    "context",
)
"""Input channels; the aligned ones are read later by the person's delay and divided by the gain."""
SHOWN = ("label", "truth", "at_stop", "valid", "yaw_rate", "robot_wheel", "context")
"""What the set encoder sees of a calibration rollout."""

CONTEXT_INPUTS = 3  # the last ones, of both
_PHASES = 2  # two samples at 20 Hz are one position of the network: half the work, same reach
_FOLD = 4  # samples that are one position of the set encoder
_MOST_DILATION = 1024  # positions; as much is added on either side of a drive
DELAY_RANGE_S = (-0.8, 1.3)  # of what was simulated
LOG_GAIN_RANGE = (-1.3, 1.3)
LOG_SPREAD_RANGE = (-7.0, 3.0)  # units: no statement is surer, or less sure, than pre-training's
MIRROR_OF_MOTION = np.array([-1.0, 1.0, -1.0])  # yaw rate, speed, robot wheel
YAW_RATE_SCALE = 0.5  # rad/s; brings the car's turning to the size of a label


@dataclass(frozen=True, kw_only=True)
class ResidualConfig:
    """Sizes of the residual network.

    Attributes:
        style_size: entries of w.
        channels: of every convolution.
        dilations: one residual block each, in positions of 0.1 s.
        style_hidden: of the layer between style and the FiLM factors.
        set_channels, set_size: of the set encoder, and what it says of a person.
    """

    style_size: int
    channels: int = 64
    dilations: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    style_hidden: int = 64
    set_channels: int = 32
    set_size: int = 24

    def __post_init__(self) -> None:
        object.__setattr__(self, "dilations", tuple(self.dilations))  # from JSON
        widths = (self.style_size, self.channels, self.style_hidden)
        sizes = (*widths, self.set_channels, self.set_size, *self.dilations)
        if min(sizes) < 1 or not self.dilations:
            raise InvalidConfig(f"{self} has a size below 1 or no block.")
        if max(self.dilations) > _MOST_DILATION:
            raise InvalidConfig(
                f"{self} has a dilation above {_MOST_DILATION}; give a smaller one."
            )


class ResidualNetwork(nn.Module):
    """Dilated residual convolutions with FiLM by style (Perez et al., AAAI 2018).

    Style is w beside what the set encoder says of the person's calibration rollouts: features of
    each position, averaged over all of them (deep sets: Zaheer et al., NeurIPS 2017).

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
            width = config.set_channels
            self.set_stem = nn.Conv1d(_FOLD * len(SHOWN), width, 5, padding=2)
            self.set_block = nn.Conv1d(width, width, 5, padding=4, dilation=2)
            self.set_out = nn.Linear(2 * width, config.set_size)
            self.style = nn.Linear(config.style_size + config.set_size, config.style_hidden)
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

    def shown_sums(self, shown: Tensor) -> Tensor:
        """Of calibration rollouts (rollouts, samples, len(SHOWN)): sums that add up, (.., pooled).

        Sums of each feature and its square over positions, and the number of positions.
        """
        rollouts, samples, channels = shown.shape
        if samples % _FOLD:
            gap = shown.new_zeros(rollouts, _FOLD - samples % _FOLD, channels)
            shown = torch.cat([shown, gap], dim=1)
        folded = shown.reshape(rollouts, -1, _FOLD * channels).transpose(1, 2)
        hidden = torch.relu(self.set_stem(folded))
        hidden = hidden + torch.relu(self.set_block(hidden))
        valid = shown[..., SHOWN.index("valid")].reshape(rollouts, 1, -1, _FOLD).amin(-1)
        hidden = hidden * valid
        sums = (hidden.sum(-1), hidden.square().sum(-1), valid.sum(-1))
        return torch.cat(sums, dim=1)

    def said_of(self, sums: Tensor) -> Tensor:
        """What the set encoder says of people, (people, set_size), from their sums."""
        width = self.config.set_channels
        count = sums[:, -1:].clamp(min=1.0)
        mean = sums[:, :width] / count
        spread = (sums[:, width : 2 * width] / count - mean.square()).clamp(min=1e-6).sqrt()
        return self.set_out(torch.cat([mean, spread], dim=1))

    def forward(self, inputs: Tensor, style: Tensor, sums: Tensor) -> tuple[Tensor, Tensor]:
        """Inputs (batch, samples, channels), w (batch, w), sums -> correction, log spread.

        Both (batch, samples): what to add to the prediction, and the log of the mean absolute
        error that remains. An odd number of samples is filled up with an absent one.
        """
        batch, samples, channels = inputs.shape
        if samples % _PHASES:
            inputs = torch.cat([inputs, inputs.new_zeros(batch, 1, channels)], dim=1)
        folded = inputs.reshape(batch, -1, _PHASES * channels).transpose(1, 2)
        known = torch.cat([style, self.said_of(sums)], dim=1)
        factors = self.film(torch.nn.functional.silu(self.style(known)))
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


def closed_form(label: FloatArray, unit: FloatArray, coefficients: FloatArray) -> FloatArray:
    """The inverse model's truth in units, once with the study's prior and once with our own.

    Args:
        label: (batch, samples).
        unit: (batch,).
        coefficients: (batch, 2, features).

    Returns:
        (batch, 2, samples).
    """
    predicted = coefficients @ inverse_features(label, unit).transpose(0, 2, 1)
    limit = WHEEL_LIMIT / unit[:, None, None]
    return np.clip(predicted, -limit, limit)


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
    label: FloatArray,
    unit: FloatArray,
    prediction: FloatArray,
    present: BoolArray,
    in_study: BoolArray,
    alignment: Alignment,
    motion: NDArray[Any] | None,
) -> Tensor:
    """Input channels: all (batch, samples), motion (batch, samples, 3) or None -> (.., channels).

    Args:
        label: in wheel units.
        unit: (batch,) what it is divided by.
        prediction: of the closed form, in units, (batch, 2, samples).
        in_study: (batch,) whether the first of them has a study's prior.
        motion: yaw rate, speed and robot wheel; without it the context channels are 0.
    """
    channels = np.zeros((*label.shape, len(INPUTS)), dtype=np.float32)
    stop = np.sign(label) * at_stop(label)
    label = label / unit[:, None]
    held = present.astype(np.float64)
    channels[..., 0] = label
    channels[..., 1:3] = prediction.transpose(0, 2, 1)
    channels[..., 3] = stop
    channels[..., 4] = 1.0
    channels[..., 5] = in_study[:, None]
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
    for channel, values in ((6, unbiased), (7, stop), (8, held)):
        channels[..., channel] = inside * (
            (1.0 - weight) * values[rows, below] + weight * values[rows, above]
        )
    channels[..., 6:8] *= channels[..., 8:9] > 0.99
    _add_motion(channels, unit, motion)
    return torch.from_numpy(channels)


def shown_inputs(
    label: FloatArray,
    truth: FloatArray,
    valid: BoolArray,
    unit: FloatArray,
    motion: NDArray[Any] | None,
) -> Tensor:
    """What the set encoder sees: all (rollouts, samples), unit (rollouts,) -> (.., len(SHOWN))."""
    channels = np.zeros((*label.shape, len(SHOWN)), dtype=np.float32)
    channels[..., 0] = label / unit[:, None]
    channels[..., 1] = truth / unit[:, None]
    channels[..., 2] = np.sign(label) * at_stop(label)
    channels[..., 3] = 1.0
    _add_motion(channels, unit, motion)
    channels[~valid] = 0.0
    return torch.from_numpy(channels)


def _add_motion(
    channels: NDArray[np.float32], unit: FloatArray, motion: NDArray[Any] | None
) -> None:
    if motion is not None:
        channels[..., -3] = motion[..., 0] / (YAW_RATE_SCALE * unit[:, None])
        channels[..., -2] = motion[..., 2] / unit[:, None]
        channels[..., -1] = 1.0


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class KnownStyle:
    """What calibration finds of people; all (people, ...).

    Attributes:
        unit: (people,) size of their truths.
        in_study: (people,) whether a study's prior is known.
        coefficients: of the closed form, with the study's prior (or again our own) and our own.
        style: w.
        sums: (people, 2, pooled) of the set encoder, of the rollouts and of their mirror images.
    """

    unit: FloatArray
    in_study: BoolArray
    coefficients: FloatArray
    style: FloatArray
    sums: NDArray[np.float32]

    def __getitem__(self, rows: NDArray[Any] | list[int] | slice) -> "KnownStyle":
        """Some of the people, in that order, also repeatedly."""
        return KnownStyle(**{one.name: getattr(self, one.name)[rows] for one in fields(self)})

    @classmethod
    def concatenate(cls, parts: Sequence["KnownStyle"]) -> "KnownStyle":
        """All people of ``parts``, in order."""

        def together(name: str) -> NDArray[Any]:
            return np.concatenate([getattr(part, name) for part in parts])

        return cls(**{one.name: together(one.name) for one in fields(cls)})


def sums_of(
    network: ResidualNetwork,
    label: FloatArray,
    truth: FloatArray,
    valid: BoolArray,
    unit: FloatArray,
    motion: FloatArray | None,
) -> NDArray[np.float32]:
    """The set encoder's sums of each rollout and of its mirror image, (rollouts, 2, pooled)."""
    mirrored = None if motion is None else motion * MIRROR_OF_MOTION
    with torch.no_grad():
        sides = [
            network.shown_sums(shown_inputs(sign * label, sign * truth, valid, unit, moved))
            for sign, moved in ((1.0, motion), (-1.0, mirrored))
        ]
    return torch.stack(sides, dim=1).numpy()


def map_labels(
    network: ResidualNetwork,
    readout: FloatArray,
    known: KnownStyle,
    label: FloatArray,
    present: BoolArray,
    motion: FloatArray | None,
    correction_share: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Mapped labels and their expected absolute error, (batch, samples) each, in wheel units.

    Averaged over the labels and their mirror image, so left and right are treated exactly alike.

    Args:
        network: frozen or fine-tuned.
        readout: see ``PretrainedModel.style_readout``.
        known: of each row's person.
        label: (batch, samples), bridged.
        present: (batch, samples).
        motion: (batch, samples, 3) or None.
        correction_share: how much of the network's correction counts; 0 leaves the closed form.
    """
    prediction = closed_form(label, known.unit, known.coefficients)
    mirrored_motion = None if motion is None else motion * MIRROR_OF_MOTION
    corrections: list[FloatArray] = []
    log_spreads: list[FloatArray] = []
    for side, (sign, w, moved) in enumerate(
        ((1.0, known.style, motion), (-1.0, mirrored_style(known.style), mirrored_motion))
    ):
        alignment = Alignment.from_style(w, readout)
        inputs = network_inputs(
            sign * label,
            known.unit,
            sign * prediction,
            present,
            known.in_study,
            alignment,
            moved,
        )
        sums = torch.from_numpy(np.ascontiguousarray(known.sums[:, side]))
        with torch.no_grad():
            correction, log_spread = network(inputs, torch.from_numpy(w.astype(np.float32)), sums)
        corrections.append(sign * correction.double().numpy())
        log_spreads.append(log_spread.double().numpy())
    unit = known.unit[:, None]
    mapped = unit * (prediction[:, 0] + correction_share * np.mean(corrections, axis=0))
    spread = unit * np.exp(np.clip(np.mean(log_spreads, axis=0), *LOG_SPREAD_RANGE))
    return np.clip(mapped, -WHEEL_LIMIT, WHEEL_LIMIT), spread
