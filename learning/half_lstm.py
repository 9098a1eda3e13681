"""An LSTM's last hidden state and its gradient: the one compiled part of learning.

``torch.nn.LSTM`` says what is computed, and computes it everywhere but in training on a processor.
There a step of 512 windows takes 10.4 ms with it and 6.4 ms with this file on one core, 4.5 ms on two
(AVX-512 machine shared with others), for the halves of a window share nothing. With
``torch.nn.LSTM`` alone ``steerlab simulate`` with 34 teachers took 1.6 times as much processor time as
with the hand-vectorised kernels that were here before. The loops are plain; what the compiler
makes of them rounds as it suits the processor.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor, nn

Float32Array = NDArray[np.float32]

LANES = 128  # windows side by side; a block of them stays in a core's own cache
TILE = 4
_HALF, _ONE, _TWO, _ZERO = (np.float32(value) for value in (0.5, 1.0, 2.0, 0.0))
_MOST, _LOG2_E = np.float32(87.0), np.float32(1.0 / np.log(2.0))
_LN_2_HIGH = np.float32(np.log(2.0))
_LN_2_LOW = np.float32(np.log(2.0) - np.float64(_LN_2_HIGH))
_E2, _E3, _E4, _E5, _E6 = (np.float32(1.0 / value) for value in (2, 6, 24, 120, 720))
_BIAS, _MANTISSA_BITS = np.int32(127), np.int32(23)

# The compiler may round a product and its sum once, and add in the order that suits the processor.
_KERNEL: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
}


@njit(inline="always", **_KERNEL)
def _exp(x: np.float32) -> np.float32:
    """e^x to 5e-7 of itself, constant beyond ±87; unlike libm's, loops over it become vector code."""
    x = _MOST if x > _MOST else x  # this way round NaN stays NaN
    x = -_MOST if x < -_MOST else x
    n = np.floor(x * _LOG2_E + _HALF)
    r = x - n * _LN_2_HIGH - n * _LN_2_LOW
    series = _ONE + r * (_ONE + r * (_E2 + r * (_E3 + r * (_E4 + r * (_E5 + r * _E6)))))
    power = np.int32((np.int32(n) + _BIAS) << _MANTISSA_BITS)
    return series * power.view(np.float32)


@njit(inline="always", **_KERNEL)
def _sigmoid(x: np.float32) -> np.float32:
    return _ONE / (_ONE + _exp(-x))


@njit(inline="always", **_KERNEL)
def _tanh(x: np.float32) -> np.float32:
    return _ONE - _TWO / (_ONE + _exp(_TWO * x))


@njit(inline="always", **_KERNEL)
def _add_product(weight: Float32Array, values: Float32Array, out: Float32Array) -> None:
    """``out += weight @ values`` in every lane: (m, n), (n, LANES), (m, LANES), in tiles."""
    for i in range(0, len(weight), TILE):
        o0, o1, o2, o3 = out[i], out[i + 1], out[i + 2], out[i + 3]
        for k in range(0, len(values), TILE):
            v0, v1, v2, v3 = values[k], values[k + 1], values[k + 2], values[k + 3]
            w = weight[i : i + TILE, k : k + TILE]
            w00, w01, w02, w03 = w[0, 0], w[0, 1], w[0, 2], w[0, 3]
            w10, w11, w12, w13 = w[1, 0], w[1, 1], w[1, 2], w[1, 3]
            w20, w21, w22, w23 = w[2, 0], w[2, 1], w[2, 2], w[2, 3]
            w30, w31, w32, w33 = w[3, 0], w[3, 1], w[3, 2], w[3, 3]
            for r in range(LANES):
                a, b, c, d = v0[r], v1[r], v2[r], v3[r]
                o0[r] = o0[r] + w00 * a + w01 * b + w02 * c + w03 * d
                o1[r] = o1[r] + w10 * a + w11 * b + w12 * c + w13 * d
                o2[r] = o2[r] + w20 * a + w21 * b + w22 * c + w23 * d
                o3[r] = o3[r] + w30 * a + w31 * b + w32 * c + w33 * d


@njit(inline="always", **_KERNEL)
def _add_outer(left: Float32Array, right: Float32Array, out: Float32Array) -> None:
    """``out += left @ right.T``: (m, LANES), (n, LANES), (m, n), in tiles of two by four."""
    for i in range(0, len(left), 2):
        a, b = left[i], left[i + 1]
        by_a, by_b = out[i], out[i + 1]
        for k in range(0, len(right), TILE):
            v0, v1, v2, v3 = right[k], right[k + 1], right[k + 2], right[k + 3]
            a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = _ZERO
            for r in range(LANES):
                x, y = a[r], b[r]
                a0 += x * v0[r]
                a1 += x * v1[r]
                a2 += x * v2[r]
                a3 += x * v3[r]
                b0 += y * v0[r]
                b1 += y * v1[r]
                b2 += y * v2[r]
                b3 += y * v3[r]
            by_a[k] += a0
            by_a[k + 1] += a1
            by_a[k + 2] += a2
            by_a[k + 3] += a3
            by_b[k] += b0
            by_b[k + 1] += b1
            by_b[k + 2] += b2
            by_b[k + 3] += b3


@njit(cache=True, **_KERNEL)
def _forward(
    weight: Float32Array, read: Float32Array, gates: Float32Array, cells: Float32Array
) -> None:
    """Fill ``gates`` and ``cells``, and the hidden units' rows of ``read``.

    Args:
        weight: (4 H, H + TILE), of what ``read`` has.
        read: (blocks, steps + 1, H + TILE, LANES): hidden units, two channels, 1 and 0.
        gates: (blocks, steps, 4 H, LANES), in torch's order.
        cells: (blocks, steps + 1, H, LANES).
    """
    units = cells.shape[2]
    for block in range(len(gates)):
        cells[block, 0] = _ZERO
        for step in range(gates.shape[1]):
            z = gates[block, step]
            z[:] = _ZERO
            _add_product(weight, read[block, step], z)
            for u in range(units):
                zi, zf, zg, zo = z[u], z[units + u], z[2 * units + u], z[3 * units + u]
                before, cell = cells[block, step, u], cells[block, step + 1, u]
                hidden = read[block, step + 1, u]
                for r in range(LANES):
                    i, f, g, o = _sigmoid(zi[r]), _sigmoid(zf[r]), _tanh(zg[r]), _sigmoid(zo[r])
                    zi[r], zf[r], zg[r], zo[r] = i, f, g, o
                    cell[r] = f * before[r] + i * g
                    hidden[r] = o * _tanh(cell[r])


@njit(cache=True, **_KERNEL)
def _backward(
    turned: Float32Array,
    read: Float32Array,
    gates: Float32Array,
    cells: Float32Array,
    by_hidden: Float32Array,
    by_weight: Float32Array,
) -> None:
    """Back through time, from the gradient by the last hidden state.

    Args:
        turned: (H, 4 H), the hidden units' weights, transposed.
        read: as ``_forward`` left it.
        gates: likewise; overwritten with the gradient by the sums that open them.
        cells: likewise.
        by_hidden: (blocks, H, LANES), overwritten.
        by_weight: (4 H, H + TILE), added to.
    """
    units, steps = cells.shape[2], gates.shape[1]
    by_cell = np.empty((units, LANES), np.float32)
    for block in range(len(gates)):
        by_cell[:] = _ZERO
        by_h = by_hidden[block]
        for step in range(steps - 1, -1, -1):
            z = gates[block, step]
            for u in range(units):
                zi, zf, zg, zo = z[u], z[units + u], z[2 * units + u], z[3 * units + u]
                before, cell = cells[block, step, u], cells[block, step + 1, u]
                by, kept = by_h[u], by_cell[u]
                for r in range(LANES):
                    i, f, g, o, shown = zi[r], zf[r], zg[r], zo[r], _tanh(cell[r])
                    by_c = kept[r] + by[r] * o * (_ONE - shown * shown)
                    zi[r] = by_c * g * i * (_ONE - i)
                    zf[r] = by_c * before[r] * f * (_ONE - f)
                    zg[r] = by_c * i * (_ONE - g * g)
                    zo[r] = by[r] * shown * o * (_ONE - o)
                    kept[r] = by_c * f
            _add_outer(z, read[block, step], by_weight)
            if step > 0:
                by_h[:] = _ZERO
                _add_product(turned, z, by_h)


class _LastHidden(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, past: Tensor, future: Tensor, *weights: Tensor) -> Tensor:
        """Two of (steps, batch, 2), two of (4 H, H + TILE) -> (batch, 2 H)."""
        batch, units = past.shape[1], len(weights[0]) // 4
        states = [_room(samples, units) for samples in (past, future)]
        _side_by_side(_forward, [(w, *state) for w, state in zip(weights, states, strict=True)])
        ctx.save_for_backward(*weights, *states[0], *states[1])
        last = [read[:, -1, :units].transpose(1, 2).reshape(-1, units) for read, _, _ in states]
        return torch.cat(last, dim=1)[:batch]

    @staticmethod
    def backward(ctx: Any, by_hidden: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore
        weights, states = ctx.saved_tensors[:2], ctx.saved_tensors[2:]
        blocks = len(states[0])
        lanes = torch.nn.functional.pad(by_hidden, (0, 0, 0, blocks * LANES - len(by_hidden)))
        halves = lanes.view(blocks, LANES, by_hidden.shape[1]).transpose(1, 2).chunk(2, dim=1)
        by_weights = [torch.zeros_like(weight) for weight in weights]
        both = zip(weights, (states[:3], states[3:]), halves, by_weights, strict=True)
        _side_by_side(
            _backward,
            [
                (w[:, : len(w) // 4].T.contiguous(), *state, by.contiguous(), by_weight)
                for w, state, by, by_weight in both
            ],
        )
        return None, None, *by_weights


def _room(samples: Tensor, units: int) -> tuple[Tensor, Tensor, Tensor]:
    """What ``_forward`` reads and fills for samples (steps, batch, 2): read, gates, cells."""
    steps, batch = samples.shape[:2]
    blocks = -(-batch // LANES)
    read = torch.zeros(blocks, steps + 1, units + TILE, LANES)
    lanes = torch.nn.functional.pad(samples, (0, 0, 0, blocks * LANES - batch))
    read[:, :steps, units : units + 2] = lanes.view(steps, blocks, LANES, 2).permute(1, 0, 3, 2)
    read[:, :steps, units + 2] = 1.0
    gates = torch.empty(blocks, steps, 4 * units, LANES)
    return read, gates, torch.empty(blocks, steps + 1, units, LANES)


def _side_by_side(kernel: Callable[..., None], calls: Sequence[tuple[Tensor, ...]]) -> None:
    """The halves share nothing: the second is left to another thread, if a core has time for it."""
    first, second = ([one.detach().numpy() for one in tensors] for tensors in calls)
    other = _other_thread().submit(kernel, *second)
    kernel(*first)
    other.result()


@cache
def _other_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=1, thread_name_prefix="half-lstm")


def last_hidden(lstms: tuple[nn.LSTM, nn.LSTM], past: Tensor, future: Tensor) -> Tensor:
    """past, future: (steps, batch, 2), as each LSTM reads them -> (batch, 2 H)."""
    return _LastHidden.apply(past, future, *(_weight(lstm) for lstm in lstms))


def _weight(lstm: nn.LSTM) -> Tensor:
    """(4 H, H + TILE), of hidden units, two channels, a constant 1 and padding."""
    by_input, by_hidden, input_bias, hidden_bias = lstm.parameters()
    beside = torch.stack([input_bias + hidden_bias, torch.zeros_like(input_bias)], dim=1)
    return torch.cat([by_hidden, by_input, beside], dim=1)
