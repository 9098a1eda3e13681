"""An LSTM over a few samples of a block of windows, and the gradient by its weights.

The equations and the order of the gates (input, forget, cell, output) are those of
``torch.nn.LSTM``, started from zeros and read at its last step.
"""

import numpy as np
from numba import njit

from steerlab.learning.kernels.fused import fma
from steerlab.learning.kernels.lanes import (
    KERNEL,
    LANES,
    Float32Array,
    add_outer,
    add_product,
    copy,
    copy_lanes,
    sigmoid,
    tanh,
)
from steerlab.learning.kernels.weights import Lstm

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
BESIDE = 4  # rows beside the hidden units that weights multiply: two channels, 1, padding


@njit(**KERNEL)
def run_lstm(
    samples: Float32Array,
    first: int,
    stride: int,
    steps: int,
    weights: Lstm,
    gates: Float32Array,
    cells: Float32Array,
    hidden: Float32Array,
) -> None:
    """Leave the last hidden state in ``hidden``.

    Args:
        samples: (length, 2 * LANES), both channels of every moment of the windows.
        first: the sample that is read first.
        stride: from one sample to the next; -1 runs back in time.
        steps: how many samples are read.
        weights: H units.
        gates: (steps, 4 H * LANES), filled for ``lstm_gradient``; fewer are used in turn.
        cells: (steps + 1, H * LANES), likewise, at least 2; from before the first step on.
        hidden: (H * LANES,), written.
    """
    size = len(hidden)
    cells[0] = _ZERO
    for step in range(steps):
        z, sample = gates[step % len(gates)], samples[first + step * stride]
        for row in range(len(weights.hidden_bias)):
            o = z[row * LANES : (row + 1) * LANES]
            w0, w1 = weights.by_input[2 * row], weights.by_input[2 * row + 1]
            bias = weights.input_bias[row] + weights.hidden_bias[row]
            for r in range(LANES):
                o[r] = fma(w1, sample[LANES + r], fma(w0, sample[r], bias))
        if step > 0:
            add_product(weights.by_hidden, hidden, z)
        _advance(
            z[:size], z[size : 2 * size], z[2 * size : 3 * size], z[3 * size :],
            cells[step % len(cells)], cells[(step + 1) % len(cells)], hidden,
        )  # fmt: skip


@njit(**KERNEL)
def _advance(
    zi: Float32Array,
    zf: Float32Array,
    zg: Float32Array,
    zo: Float32Array,
    before: Float32Array,
    cell: Float32Array,
    hidden: Float32Array,
) -> None:
    """One step; the sums in ``z`` become the gates that they open."""
    for r in range(len(zi)):
        i, f, g, o = sigmoid(zi[r]), sigmoid(zf[r]), tanh(zg[r]), sigmoid(zo[r])
        zi[r], zf[r], zg[r], zo[r] = i, f, g, o
        c = fma(f, before[r], i * g)
        cell[r] = c
        hidden[r] = o * tanh(c)


@njit(**KERNEL)
def lstm_gradient(
    samples: Float32Array,
    first: int,
    stride: int,
    turned: Float32Array,
    gates: Float32Array,
    cells: Float32Array,
    by_hidden: Float32Array,
    scratch: Float32Array,
    steps_scratch: Float32Array,
    gradient: Lstm,
) -> None:
    """Back through time: write the gradient by the weights, summed over the lanes.

    Args:
        samples: as for ``run_lstm``, and likewise ``first`` and ``stride``.
        turned: (H * 4 H,), the hidden units' weights, transposed.
        gates: as ``run_lstm`` left them, every step.
        cells: likewise.
        by_hidden: (H * LANES,), the loss's gradient by the last hidden state; overwritten.
        scratch: (6 H * LANES,) to work in.
        steps_scratch: ((5 H + BESIDE) * steps * LANES,) or more to work in.
        gradient: written.
    """
    steps, size = len(gates), len(by_hidden)
    length, rows = steps * LANES, size // LANES
    by_cell, hidden, by_z = scratch[:size], scratch[size : 2 * size], scratch[2 * size :]
    all_by_z = steps_scratch[: 4 * rows * length]
    multiplied = steps_scratch[4 * rows * length : (5 * rows + BESIDE) * length]
    beside = multiplied[rows * length :]
    by_cell[:] = _ZERO
    for row in range(rows):
        multiplied[row * length : row * length + LANES] = _ZERO  # before the first step
    beside[2 * length :] = _ONE
    beside[3 * length :] = _ZERO
    for step in range(steps - 1, -1, -1):
        z = gates[step]
        _retreat(
            z[:size], z[size : 2 * size], z[2 * size : 3 * size], z[3 * size :],
            cells[step], cells[step + 1], by_hidden, by_cell, hidden,
            by_z[:size], by_z[size : 2 * size], by_z[2 * size : 3 * size], by_z[3 * size :],
        )  # fmt: skip
        copy_lanes(by_z, all_by_z, length, step)
        copy_lanes(samples[first + step * stride], beside, length, step)
        if step + 1 < steps:
            copy_lanes(hidden, multiplied, length, step + 1)
        if step > 0:
            by_hidden[:] = _ZERO
            add_product(turned, by_z, by_hidden)
    columns = rows + BESIDE
    by_all = np.zeros(4 * rows * columns, np.float32)
    add_outer(all_by_z, multiplied, 4 * rows, by_all)
    for row in range(4 * rows):
        of_row = by_all[row * columns : (row + 1) * columns]
        copy(of_row[:rows], gradient.by_hidden[row * rows : (row + 1) * rows])
        copy(of_row[rows : rows + 2], gradient.by_input[2 * row : 2 * row + 2])
        gradient.input_bias[row] = gradient.hidden_bias[row] = of_row[rows + 2]


@njit(**KERNEL)
def _retreat(
    gate_i: Float32Array,
    gate_f: Float32Array,
    gate_g: Float32Array,
    gate_o: Float32Array,
    before: Float32Array,
    cell: Float32Array,
    by_hidden: Float32Array,
    by_cell: Float32Array,
    hidden: Float32Array,
    by_i: Float32Array,
    by_f: Float32Array,
    by_g: Float32Array,
    by_o: Float32Array,
) -> None:
    """One step back; ``by_cell`` goes from this step's to the step before's, ``hidden`` is redone."""
    for r in range(len(gate_i)):
        i, f, g, o = gate_i[r], gate_f[r], gate_g[r], gate_o[r]
        shown = tanh(cell[r])
        by_h = by_hidden[r]
        by_c = fma(by_h * o, _ONE - shown * shown, by_cell[r])
        hidden[r] = o * shown
        by_i[r] = by_c * g * i * (_ONE - i)
        by_f[r] = by_c * before[r] * f * (_ONE - f)
        by_g[r] = by_c * i * (_ONE - g * g)
        by_o[r] = by_h * shown * o * (_ONE - o)
        by_cell[r] = by_c * f
