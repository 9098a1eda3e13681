"""Gauss-Newton's sums over each person's windows: what calibration solves for w."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from numba import njit
from torch import Tensor

from steerlab.learning.kernels.fused import TILE
from steerlab.learning.kernels.heads import Layers, run_f, run_g
from steerlab.learning.kernels.lanes import (
    KERNEL,
    LANES,
    Float32Array,
    add_outer,
    add_product,
    exp,
    padded,
)
from steerlab.learning.kernels.weights import Sizes, Weights, pack, sizes_of, split
from steerlab.learning.mind_meld import LOG_SIGMA_RANGE, MindMeld

Float64Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_ZERO, _ONE, _TWO = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_LEAST_LOG_SIGMA, _MOST_LOG_SIGMA = (np.float32(end) for end in LOG_SIGMA_RANGE)


class Sums(NamedTuple):
    """Over each person's windows, float64.

    Attributes:
        loss: (people,), of squared residuals.
        gradient: (people, d), J'r: half the loss's derivative by w.
        matrix: (people, d, d), J'J.
        sigma_square: (people, d), of g.
    """

    loss: Tensor
    gradient: Tensor
    matrix: Tensor
    sigma_square: Tensor


class NormalEquations:
    """Both terms of Eq. 2 as least squares in w, g's mean in place of a sample.

    Args:
        network: is copied.
        encoding: (windows, k), one person's after another's.
        difference: (windows,), the true ``a - o``.
        counts: (people,), each at least 1.
    """

    def __init__(
        self, network: MindMeld, encoding: Tensor, difference: Tensor, counts: Tensor
    ) -> None:
        self.counts = counts
        self._sizes, self._vector = sizes_of(network), pack(network).numpy()
        self._encoding = encoding.contiguous().numpy()
        self._difference = difference.contiguous().numpy()
        self._values, self._slopes = Layers.zeros(self._sizes), Layers.zeros(self._sizes)

    def sums(self, embeddings: Tensor, weight: float, strides: Tensor) -> tuple[Sums, Tensor]:
        """The sums, and every residual of the difference, (windows,).

        Args:
            embeddings: (people, d).
            weight: lambda.
            strides: (people,) int64; only every so many of the windows are read. The others'
                residuals are 0.
        """
        people, size = embeddings.shape
        shapes = ((people,), (people, size), (people, size, size), (people, size))
        sums = Sums(*(torch.zeros(shape, dtype=torch.float64) for shape in shapes))
        residual = torch.zeros(len(self._difference))
        _add_people(
            self._sizes,
            self._vector,
            self._encoding,
            self._difference,
            self.counts.numpy(),
            strides.numpy(),
            embeddings.contiguous().numpy(),
            weight / size,
            self._values,
            self._slopes,
            (
                sums.loss.numpy(),
                sums.gradient.numpy(),
                sums.matrix.numpy(),
                sums.sigma_square.numpy(),
            ),
            residual.numpy(),
        )
        return sums, residual


@njit(**KERNEL)
def _add_people(
    sizes: Sizes,
    vector: Float32Array,
    encoding: Float32Array,
    difference: Float32Array,
    counts: IntArray,
    strides: IntArray,
    embeddings: Float32Array,
    scale: float,
    values: Layers,
    slopes: Layers,
    sums: tuple[Float64Array, Float64Array, Float64Array, Float64Array],
    residual: Float32Array,
) -> None:
    weights = split(vector, sizes)
    by_w = _slope_of_f(sizes, weights)
    losses, gradients, matrices, sigma_squares = sums
    end = 0
    for person in range(len(counts)):
        first, stride = end, strides[person]
        end = first + counts[person]
        for row in range(sizes.embedding):
            at = (sizes.encoding + row) * LANES
            values.f_input[at : at + LANES] = embeddings[person, row]
        for start in range(first, end, stride * LANES):
            count = min(LANES, (end - start + stride - 1) // stride)
            for r in range(count):
                for row in range(sizes.encoding):
                    value = encoding[start + r * stride, row]
                    values.f_input[row * LANES + r] = values.g_input[row * LANES + r] = value
            run_f(sizes, weights, values)
            run_g(weights, values)
            _run_slopes(sizes, weights, by_w, values, slopes)
            for r in range(count):
                at = start + r * stride
                residual[at] = values.f_out[r] - difference[at]
                slopes.f_out[r] = residual[at]
            losses[person] += _add_block(
                sizes,
                np.float32(scale),
                count,
                embeddings[person],
                values,
                slopes,
                gradients[person],
                matrices[person],
                sigma_squares[person],
            )


@njit(**KERNEL)
def _slope_of_f(sizes: Sizes, weights: Weights) -> Float32Array:
    """(d * hidden,): what each hidden unit, where it is on, adds to the derivative of f by w."""
    hidden = len(weights.f_hidden.bias)
    columns = len(weights.f_hidden.weight) // hidden
    slope = np.zeros(padded(sizes.embedding) * hidden, np.float32)
    for row in range(sizes.embedding):
        for unit in range(hidden):
            by_w = weights.f_hidden.weight[unit * columns + sizes.encoding + row]
            slope[row * hidden + unit] = weights.f_out.weight[unit] * by_w
    return slope


@njit(**KERNEL)
def _run_slopes(
    sizes: Sizes, weights: Weights, by_w: Float32Array, values: Layers, slopes: Layers
) -> None:
    """Derivatives of f by w, to ``slopes.f_input``, and of g by d, to ``slopes.g_last``."""
    for r in range(len(values.f_hidden)):
        slopes.f_hidden[r] = _ONE if values.f_hidden[r] > _ZERO else _ZERO
    f_slope = slopes.f_input[: padded(sizes.embedding) * LANES]
    f_slope[:] = _ZERO
    add_product(by_w, slopes.f_hidden, f_slope)
    columns = len(values.g_input) // LANES
    for unit in range(len(weights.g_first.bias)):
        by_d = weights.g_first.weight[unit * columns + sizes.encoding]
        for r in range(unit * LANES, (unit + 1) * LANES):
            slopes.g_first[r] = by_d if values.g_first[r] > _ZERO else _ZERO
    slopes.g_second[:] = _ZERO
    add_product(weights.g_second.weight, slopes.g_first, slopes.g_second)
    for r in range(len(slopes.g_second)):
        slopes.g_second[r] = slopes.g_second[r] if values.g_second[r] > _ZERO else _ZERO
    slopes.g_last[:] = _ZERO
    add_product(weights.g_last.weight, slopes.g_second, slopes.g_last)


@njit(**KERNEL)
def _add_block(
    sizes: Sizes,
    scale: np.float32,
    count: int,
    embedding: Float32Array,
    values: Layers,
    slopes: Layers,
    gradient: Float64Array,
    matrix: Float64Array,
    sigma_square: Float64Array,
) -> np.float32:
    """Add the first ``count`` lanes; returns their loss.

    With b the derivative of f by w, g's mean m and its derivative s by the difference, a window's
    second residual is ``m - w`` and its derivative ``s b' - I``.
    """
    size = padded(sizes.embedding)
    b, s = slopes.f_input[: size * LANES], slopes.g_last[: size * LANES]
    weighted, pull = np.zeros_like(b), np.zeros(TILE * LANES, np.float32)
    curvature, loss = np.zeros(LANES, np.float32), _ZERO
    for r in range(count):
        residual = slopes.f_out[r]
        loss += residual * residual
        pull[r], curvature[r] = residual, _ONE  # of each window along its b; 0 in lanes beyond
    for i in range(sizes.embedding):
        at, total, square, sigmas = i * LANES, _ZERO, _ZERO, _ZERO
        log_sigma = values.g_last[(sizes.embedding + i) * LANES :]
        for r in range(count):
            away = values.g_last[at + r] - embedding[i]
            total += away
            square += away * away
            pull[r] += scale * s[at + r] * away
            curvature[r] += scale * s[at + r] * s[at + r]
            sigmas += exp(_TWO * min(max(log_sigma[r], _LEAST_LOG_SIGMA), _MOST_LOG_SIGMA))
        loss += scale * square
        gradient[i] -= scale * total
        matrix[i, i] += scale * np.float32(count)
        sigma_square[i] += sigmas
    # b b' by the curvature, less s b' and its transpose.
    for r in range(len(b)):
        inside = scale if r % LANES < count else _ZERO
        weighted[r] = b[r] * curvature[r % LANES]
        s[r] *= inside
    products, crossed = np.zeros(size * size, np.float32), np.zeros(size * size, np.float32)
    along = np.zeros(size * TILE, np.float32)
    add_outer(weighted, b, size, products)
    add_outer(s, b, size, crossed)
    add_outer(b, pull, size, along)
    for i in range(sizes.embedding):
        gradient[i] += along[i * TILE]
        for j in range(sizes.embedding):
            cross = crossed[i * size + j] + crossed[j * size + i]
            matrix[i, j] += products[i * size + j] - cross
    return loss
