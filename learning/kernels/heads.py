"""f and g behind the encoder, a block of windows at a time, and the gradient of Eq. 2 through them.

What is computed is ``mind_meld_loss`` in ``training.py``; this is the same by hand.
"""

from typing import NamedTuple

import numpy as np
import torch
from numba import njit

from steerlab.learning.kernels.fused import TILE
from steerlab.learning.kernels.lanes import (
    KERNEL,
    LANES,
    Float32Array,
    add_outer,
    add_product,
    copy,
    exp,
    padded,
    transposed,
)
from steerlab.learning.kernels.weights import Dense, Sizes, Weights
from steerlab.learning.mind_meld import LOG_SIGMA_RANGE

_ZERO, _HALF, _ONE, _TWO = (np.float32(value) for value in (0.0, 0.5, 1.0, 2.0))


class Layers(NamedTuple):
    """Values between the layers, (units * LANES,) each, or the loss's gradient by them."""

    states: Float32Array  # both LSTMs' at the centre
    encoding: Float32Array  # z
    f_input: Float32Array  # z and w
    f_hidden: Float32Array
    f_out: Float32Array  # the predicted difference, d
    g_input: Float32Array  # z and d
    g_first: Float32Array
    g_second: Float32Array
    g_last: Float32Array  # mean and log sigma of w

    @classmethod
    def zeros(cls, sizes: Sizes) -> "Layers":
        """Room for a block; torch aligns to cache lines. Padding stays 0 for good."""
        units = (
            2 * sizes.units,
            sizes.encoding,
            sizes.encoding + sizes.embedding,
            sizes.hidden,
            1,
            sizes.encoding + 1,
            sizes.first,
            sizes.second,
            2 * sizes.embedding,
        )
        return cls(*(torch.zeros(padded(count) * LANES).numpy() for count in units))


class Loss(NamedTuple):
    """What Eq. 2 needs besides the network.

    Attributes:
        embedding_weight: lambda.
        huber: from where the difference's loss is linear; 0 squares everywhere.
        least_log_sigma, most_log_sigma: to which log sigma is clamped.
    """

    embedding_weight: np.float32
    huber: np.float32
    least_log_sigma: np.float32
    most_log_sigma: np.float32

    @classmethod
    def of(cls, embedding_weight: float, huber: float | None) -> "Loss":
        """As ``TrainingConfig`` has them."""
        return cls(*(np.float32(one) for one in (embedding_weight, huber or 0.0, *LOG_SIGMA_RANGE)))


@njit(**KERNEL)
def run_encoding(weights: Weights, values: Layers) -> None:
    """From ``states`` to ``encoding``."""
    _run(weights.encode, values.states, values.encoding)


@njit(**KERNEL)
def run_f(sizes: Sizes, weights: Weights, values: Layers) -> None:
    """From ``f_input``, z and w, to ``f_out`` and its row of ``g_input``."""
    _run(weights.f_hidden, values.f_input, values.f_hidden)
    _relu(values.f_hidden)
    _run(weights.f_out, values.f_hidden, values.f_out)
    copy(values.f_out[:LANES], values.g_input[sizes.encoding * LANES :])


@njit(**KERNEL)
def run_g(weights: Weights, values: Layers) -> None:
    """From ``g_input``, z and d, to ``g_last``."""
    _run(weights.g_first, values.g_input, values.g_first)
    _relu(values.g_first)
    _run(weights.g_second, values.g_first, values.g_second)
    _relu(values.g_second)
    _run(weights.g_last, values.g_second, values.g_last)


@njit(**KERNEL)
def run_heads(sizes: Sizes, weights: Weights, values: Layers) -> None:
    """From ``states`` and the rows of w in ``f_input`` to every other layer."""
    size = sizes.encoding * LANES
    run_encoding(weights, values)
    copy(values.encoding[:size], values.f_input)
    copy(values.encoding[:size], values.g_input)
    run_f(sizes, weights, values)
    run_g(weights, values)


@njit(**KERNEL)
def loss_gradient(
    sizes: Sizes,
    loss: Loss,
    values: Layers,
    target: Float32Array,
    noise: Float32Array,
    batch: int,
    by: Layers,
    losses: Float32Array,
) -> None:
    """Both losses' share of these windows, and the gradient by f's and g's output and by w.

    Args:
        sizes: of the networks.
        loss: how to weigh.
        values: of ``run_heads``.
        target: (windows,), the true ``a - o``; at most LANES windows.
        noise: (windows, d), standard normal.
        batch: how many windows the mean goes over.
        by: ``f_out``, ``g_last`` and the rows of w in ``f_input`` are written; 0 in lanes beyond.
        losses: (2,), written: difference and embedding.
    """
    of_difference, of_embedding, windows = _ZERO, _ZERO, np.float32(batch)
    by.f_out[:LANES] = _ZERO
    by.g_last[:] = _ZERO
    by.f_input[:] = _ZERO
    for r in range(len(target)):
        error = values.f_out[r] - target[r]
        if loss.huber == _ZERO:
            of_difference += error * error
            by.f_out[r] = _TWO * error / windows
        elif abs(error) <= loss.huber:
            of_difference += _HALF * error * error / loss.huber
            by.f_out[r] = error / loss.huber / windows
        else:
            of_difference += abs(error) - _HALF * loss.huber
            by.f_out[r] = (_ONE if error > _ZERO else -_ONE) / windows
    count = windows * np.float32(sizes.embedding)
    for dimension in range(sizes.embedding):
        mean_row, sigma_row = dimension * LANES, (sizes.embedding + dimension) * LANES
        own_row = (sizes.encoding + dimension) * LANES
        for r in range(len(target)):
            log_sigma = values.g_last[sigma_row + r]
            kept = min(max(log_sigma, loss.least_log_sigma), loss.most_log_sigma)
            spread = exp(kept) * noise[r, dimension]
            away = values.g_last[mean_row + r] + spread - values.f_input[own_row + r]
            of_embedding += away * away
            slope = loss.embedding_weight * _TWO * away / count
            by.g_last[mean_row + r] = slope
            if kept == log_sigma:
                by.g_last[sigma_row + r] = slope * spread
            by.f_input[own_row + r] = -slope
    losses[0], losses[1] = of_difference / windows, of_embedding / count


@njit(**KERNEL)
def heads_gradient(
    sizes: Sizes, weights: Weights, values: Layers, by: Layers, gradient: Weights
) -> None:
    """From what ``loss_gradient`` wrote back to ``by.states`` and the weights' gradient."""
    size = sizes.encoding * LANES
    _back(weights.g_last, values.g_second, by.g_last, by.g_second, gradient.g_last)
    _relu_gradient(values.g_second, by.g_second)
    _back(weights.g_second, values.g_first, by.g_second, by.g_first, gradient.g_second)
    _relu_gradient(values.g_first, by.g_first)
    _back(weights.g_first, values.g_input, by.g_first, by.g_input, gradient.g_first)
    for r in range(LANES):
        by.f_out[r] += by.g_input[size + r]
    _back(weights.f_out, values.f_hidden, by.f_out, by.f_hidden, gradient.f_out)
    _relu_gradient(values.f_hidden, by.f_hidden)
    by_w = np.empty_like(by.f_input)
    copy(by.f_input, by_w)
    _back(weights.f_hidden, values.f_input, by.f_hidden, by.f_input, gradient.f_hidden)
    for r in range(len(by_w)):
        by.f_input[r] += by_w[r]
    for r in range(size):
        by.encoding[r] = by.f_input[r] + by.g_input[r]
    _back(weights.encode, values.states, by.encoding, by.states, gradient.encode)


@njit(**KERNEL)
def _run(layer: Dense, values: Float32Array, out: Float32Array) -> None:
    for row in range(len(layer.bias)):
        out[row * LANES : (row + 1) * LANES] = layer.bias[row]
    add_product(layer.weight, values, out)


@njit(**KERNEL)
def _back(
    layer: Dense,
    values: Float32Array,
    by_out: Float32Array,
    by_values: Float32Array,
    gradient: Dense,
) -> None:
    """The gradient by a layer's input and weights, from that by its output; both are written."""
    by_values[:] = _ZERO
    add_product(transposed(layer.weight, len(values) // LANES), by_out, by_values)
    gradient.weight[:] = _ZERO
    add_outer(by_out, values, len(layer.bias), gradient.weight)
    ones = np.ones(TILE * LANES, np.float32)
    totals = np.zeros(TILE * len(layer.bias), np.float32)
    add_outer(by_out, ones, len(layer.bias), totals)
    for row in range(len(layer.bias)):
        gradient.bias[row] = totals[row * TILE]


@njit(**KERNEL)
def _relu(values: Float32Array) -> None:
    for r in range(len(values)):
        value = values[r]
        values[r] = _ZERO if value < _ZERO else value  # this way round NaN stays NaN


@njit(**KERNEL)
def _relu_gradient(values: Float32Array, by: Float32Array) -> None:
    for r in range(len(values)):
        by[r] = by[r] if values[r] > _ZERO else _ZERO
