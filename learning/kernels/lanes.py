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

Float32Array = NDArray[np.float32]

LANES = 128  # measured: 64 is a fifth slower, 192 leaves the cache
TILE = 4

# No "nnan" and "ninf": a diverging network must show as NaN. "reassoc" lets a sum over lanes be
# taken in vectors. Division by zero gives inf, as in numpy, not a Python exception.
KERNEL: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
}

_ZERO, _HALF, _ONE, _TWO = (np.float32(value) for value in (0.0, 0.5, 1.0, 2.0))
_MOST = np.float32(87.0)  # exp of it is the largest power of e below float32's end
_LOG2_E = np.float32(1.0 / np.log(2.0))
_LN_2 = np.float32(np.log(2.0))
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
    n = np.floor(x * _LOG2_E + _HALF)
    r = x - n * _LN_2
    series = _ONE + r * (_ONE + r * (_E2 + r * (_E3 + r * (_E4 + r * (_E5 + r * _E6)))))
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
                o[r] += w00 * v0 + w01 * v1 + w02 * v2 + w03 * v3
                o[LANES + r] += w10 * v0 + w11 * v1 + w12 * v2 + w13 * v3
                o[2 * LANES + r] += w20 * v0 + w21 * v1 + w22 * v2 + w23 * v3
                o[3 * LANES + r] += w30 * v0 + w31 * v1 + w32 * v2 + w33 * v3


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
        a0, a1, a2, a3 = a[:length], a[length:], a[2 * length :], a[3 * length :]
        o = out[i * columns : (i + TILE) * columns]
        for k in range(0, columns, TILE):
            b = right[k * length : (k + TILE) * length]
            b0, b1, b2, b3 = b[:length], b[length:], b[2 * length :], b[3 * length :]
            s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = _ZERO
            s20 = s21 = s22 = s23 = s30 = s31 = s32 = s33 = _ZERO
            for r in range(length):
                p0, p1, p2, p3 = a0[r], a1[r], a2[r], a3[r]
                q0, q1, q2, q3 = b0[r], b1[r], b2[r], b3[r]
                s00, s01, s02, s03 = s00 + p0 * q0, s01 + p0 * q1, s02 + p0 * q2, s03 + p0 * q3
                s10, s11, s12, s13 = s10 + p1 * q0, s11 + p1 * q1, s12 + p1 * q2, s13 + p1 * q3
                s20, s21, s22, s23 = s20 + p2 * q0, s21 + p2 * q1, s22 + p2 * q2, s23 + p2 * q3
                s30, s31, s32, s33 = s30 + p3 * q0, s31 + p3 * q1, s32 + p3 * q2, s33 + p3 * q3
            sums = ((s00, s01, s02, s03), (s10, s11, s12, s13),
                    (s20, s21, s22, s23), (s30, s31, s32, s33))  # fmt: skip
            for row in range(TILE):
                for column in range(TILE):
                    o[row * columns + k + column] += sums[row][column]


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
