"""The encoder: two LSTMs that meet at the centre of a block of windows."""

import numpy as np
import numpy.typing as npt
import torch
from numba import njit
from torch import Tensor

from steerlab.learning.kernels.heads import Layers, run_encoding
from steerlab.learning.kernels.lanes import KERNEL, LANES, Float32Array, copy, padded
from steerlab.learning.kernels.lstm import run_lstm
from steerlab.learning.kernels.weights import Sizes, Weights, pack, sizes_of, split
from steerlab.learning.mind_meld import MindMeld
from steerlab.sim.errors import InvalidConfig

IntArray = npt.NDArray[np.int64]


@njit(**KERNEL)
def read_samples(
    inputs: Float32Array, row: IntArray, sign: Float32Array, samples: Float32Array
) -> None:
    """Lay windows side by side.

    Args:
        inputs: (all windows, length, 2).
        row: (count,), which of them; at most LANES.
        sign: (count,), factors of their first channel.
        samples: (length, 2 * LANES), written; 0 in lanes beyond.
    """
    samples[:] = np.float32(0.0)
    for r in range(len(row)):
        window = inputs[row[r]]
        for at in range(len(window)):
            samples[at, r] = sign[r] * window[at, 0]
            samples[at, LANES + r] = window[at, 1]


@njit(**KERNEL)
def run_halves(
    weights: Weights,
    samples: Float32Array,
    gates: tuple[Float32Array, Float32Array],
    cells: tuple[Float32Array, Float32Array],
    hidden: Float32Array,
    size: int,
    states: Float32Array,
) -> None:
    """The forward LSTM from the first sample to the centre, the backward one from the last to it.

    Args:
        weights: of the network.
        samples: (length, 2 * LANES).
        gates, cells: of both halves; see ``run_lstm``.
        hidden: (H * LANES,) to work in.
        size: LANES times the units without padding.
        states: (2 size or more,), written.
    """
    both = (weights.past, weights.future)
    for half in range(2):
        first, stride, steps = half_of(half, len(samples))
        run_lstm(samples, first, stride, steps, both[half], gates[half], cells[half], hidden)
        copy(hidden[:size], states[half * size :])


@njit(**KERNEL)
def half_of(half: int, length: int) -> tuple[int, int, int]:
    """What each LSTM reads: first sample, stride, steps; both end at the centre."""
    return half * (length - 1), 1 - 2 * half, length // 2 + 1 if half == 0 else length - length // 2


def encode_windows(network: MindMeld, inputs: Tensor) -> Tensor:
    """E without a gradient: (windows, length, channels) -> z (windows, k).

    Raises:
        InvalidConfig: inputs or network are not float32.
    """
    if inputs.dtype != torch.float32:
        raise InvalidConfig(
            f"The kernels compute in float32, and the windows are {inputs.dtype}; call .float()."
        )
    sizes = sizes_of(network)
    rows, length = padded(sizes.units), inputs.shape[1]
    encoding = torch.empty(len(inputs), sizes.encoding)
    _encode(
        sizes,
        pack(network).numpy(),
        inputs.detach().contiguous().numpy(),
        torch.empty(length, 2 * LANES).numpy(),
        torch.empty(2, 4 * rows * LANES).numpy(),  # nothing is kept beyond a step
        torch.empty(2, rows * LANES).numpy(),
        torch.empty(rows * LANES).numpy(),
        Layers.zeros(sizes),
        encoding.numpy(),
    )
    return encoding


@njit(**KERNEL)
def _encode(
    sizes: Sizes,
    vector: Float32Array,
    inputs: Float32Array,
    samples: Float32Array,
    gates: Float32Array,
    cells: Float32Array,
    hidden: Float32Array,
    values: Layers,
    encoding: Float32Array,
) -> None:
    weights = split(vector, sizes)
    sign = np.ones(LANES, np.float32)
    for start in range(0, len(inputs), LANES):
        row = np.arange(start, min(start + LANES, len(inputs)))
        read_samples(inputs, row, sign, samples)
        run_halves(
            weights, samples, (gates, gates), (cells, cells), hidden, sizes.units * LANES,
            values.states,
        )  # fmt: skip
        run_encoding(weights, values)
        for r in range(len(row)):
            for unit in range(sizes.encoding):
                encoding[start + r, unit] = values.encoding[unit * LANES + r]
