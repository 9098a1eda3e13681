"""What the kernels are built of: many windows side by side, a window a lane.

A block holds ``LANES`` windows. Its values are flat arrays (units * LANES,): unit u of lane r at
``u * LANES + r``. The inner loops run over the lanes with a length known when they are compiled,
which is what lets LLVM turn them into wide vector code without checks and remainders; weights are
scalars there, each used LANES times. The four-by-four tiles let a value that was loaded be used
four times; sizes are therefore multiples of ``TILE``, and ``padded`` makes them so.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.learning.kernels.fused import TILE, dots, fma

Float32Array = NDArray[np.float32]

LANES = 128  # measured: 64 is a fifth slower, 192 leaves the cache

# Never with "fastmath", see ``fused``. Division by zero gives inf, as in numpy, and no exception.
KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}

_HALF, _ONE, _TWO = (np.float32(value) for value in (0.5, 1.0, 2.0))
_MOST = np.float32(87.0)  # exp of it is the largest power of e below float32's end
_LOG2_E = np.float32(1.0 / np.log(2.0))
_LN_2_HIGH = np.float32(np.log(2.0))
_LN_2_LOW = np.float32(np.log(2.0) - np.float64(_LN_2_HIGH))
_E2, _E3, _E4, _E5, _E6 = (np.float32(1.0 / value) for value in (2, 6, 24, 120, 720))
_EXPONENT_BIAS = np.int32(127)
_MANTISSA_BITS = np.int32(23)


@njit(**KERNEL)
def padded(size: int) -> int:
    """The next multiple of ``TILE``."""
    return (size + TILE - 1) // TILE * TILE


@njit(**KERNEL)
def exp(x: np.float32) -> np.float32:
    """e^x = 2^n e^r with r within ±ln(2) / 2, to 5e-7 of itself; constant beyond ±87.

    e^r is Taylor's series to r^6, 2^n is written into the exponent of a float32.
    """
    x = _MOST if x > _MOST else x  # this way round NaN stays NaN
    x = -_MOST if x < -_MOST else x
    n = np.floor(fma(x, _LOG2_E, _HALF))
    r = fma(n, -_LN_2_LOW, fma(n, -_LN_2_HIGH, x))
    series = fma(r, fma(r, fma(r, _E6, _E5), _E4), _E3)
    series = fma(r, fma(r, fma(r, series, _E2), _ONE), _ONE)
    power = np.int32((np.int32(n) + _EXPONENT_BIAS) << _MANTISSA_BITS)
    return series * power.view(np.float32)


@njit(**KERNEL)
def sigmoid(x: np.float32) -> np.float32:
    """1 / (1 + e^-x), to 1e-7."""
    return _ONE / (_ONE + exp(-x))


@njit(**KERNEL)
def tanh(x: np.float32) -> np.float32:
    """To 2e-7 absolute."""
    return _ONE - _TWO / (_ONE + exp(_TWO * x))


@njit(**KERNEL)
def add_product(weight: Float32Array, values: Float32Array, out: Float32Array) -> None:
    """``out += weight @ values`` in every lane.

    Args:
        weight: (m * n,), row by row.
        values: (n * LANES,).
        out: (m * LANES,).
    """
    columns = len(values) // LANES
    for i in range(0, len(out) // LANES, TILE):
        o = out[i * LANES : (i + TILE) * LANES]
        w = weight[i * columns : (i + TILE) * columns]
        w0, w1, w2, w3 = w[:columns], w[columns:], w[2 * columns :], w[3 * columns :]
        for k in range(0, columns, TILE):
            v = values[k * LANES : (k + TILE) * LANES]
            w00, w01, w02, w03 = w0[k], w0[k + 1], w0[k + 2], w0[k + 3]
            w10, w11, w12, w13 = w1[k], w1[k + 1], w1[k + 2], w1[k + 3]
            w20, w21, w22, w23 = w2[k], w2[k + 1], w2[k + 2], w2[k + 3]
            w30, w31, w32, w33 = w3[k], w3[k + 1], w3[k + 2], w3[k + 3]
            for r in range(LANES):
                v0, v1, v2, v3 = v[r], v[LANES + r], v[2 * LANES + r], v[3 * LANES + r]
                o0 = fma(w01, v1, fma(w00, v0, o[r]))
                o[r] = fma(w03, v3, fma(w02, v2, o0))
                o1 = fma(w11, v1, fma(w10, v0, o[LANES + r]))
                o[LANES + r] = fma(w13, v3, fma(w12, v2, o1))
                o2 = fma(w21, v1, fma(w20, v0, o[2 * LANES + r]))
                o[2 * LANES + r] = fma(w23, v3, fma(w22, v2, o2))
                o3 = fma(w31, v1, fma(w30, v0, o[3 * LANES + r]))
                o[3 * LANES + r] = fma(w33, v3, fma(w32, v2, o3))


@njit(**KERNEL)
def add_outer(left: Float32Array, right: Float32Array, rows: int, out: Float32Array) -> None:
    """``out += left @ right.T``, sums over long rows: the gradient of a weight.

    Args:
        left: (m * length,), row by row.
        right: (n * length,).
        rows: m.
        out: (m * n,).
    """
    length = len(left) // rows
    columns = len(right) // length
    for i in range(0, rows, TILE):
        a = left[i * length : (i + TILE) * length]
        o = out[i * columns : (i + TILE) * columns]
        for k in range(0, columns, TILE):
            sums = dots(a, right[k * length : (k + TILE) * length], length)
            for row in range(TILE):
                for column in range(TILE):
                    o[row * columns + k + column] += sums[row * TILE + column]


@njit(**KERNEL)
def copy_lanes(values: Float32Array, rows: Float32Array, length: int, step: int) -> None:
    """Lay a step's values, (n * LANES,), beside those of other steps: rows (n * length,)."""
    for unit in range(len(values) // LANES):
        start = unit * length + step * LANES
        copy(values[unit * LANES : (unit + 1) * LANES], rows[start : start + LANES])


@njit(**KERNEL)
def copy(source: Float32Array, target: Float32Array) -> None:
    """``target[:] = source`` without the check of shapes, whose message is slow to compile."""
    for r in range(len(source)):
        target[r] = source[r]


@njit(**KERNEL)
def transposed(weight: Float32Array, columns: int) -> Float32Array:
    """(m * n,) -> (n * m,)."""
    rows = len(weight) // columns
    turned = np.empty_like(weight)
    for row in range(rows):
        for column in range(columns):
            turned[column * rows + row] = weight[row * columns + column]
    return turned
