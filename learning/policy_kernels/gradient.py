"""The weighted mean squared error of a batch and its gradient, without autograd."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.learning.kernels.lanes import KERNEL, Float32Array
from steerlab.learning.policy import Frames
from steerlab.learning.policy_kernels.forward import block_of, read, run_block
from steerlab.learning.policy_kernels.layers import (
    Layer,
    by_values,
    by_weights,
    input_size,
    inside,
    output_size,
)
from steerlab.learning.policy_kernels.layout import Sizes, Values, Weights, split, turned
from steerlab.learning.policy_kernels.products import LANES


class ByValues(NamedTuple):
    """Gradients by the layers' outputs before they were rectified, by block, without margins."""

    first: Float32Array
    second: Float32Array
    third: Float32Array
    hidden: Float32Array
    wheel: Float32Array

    @classmethod
    def of(cls, sizes: Sizes, blocks: int) -> "ByValues":
        """Room for them."""
        layers = (sizes.first, sizes.second, sizes.third, sizes.hidden)
        floats = (*(output_size(layer) for layer in layers), LANES)
        return cls(*(np.zeros(blocks * size, np.float32) for size in floats))


class Rows(NamedTuple):
    """What a policy is to imitate: (rows, 3 * 16 * 32) uint8, (rows, 5), (rows,), (rows,)."""

    images: Frames
    motions: Float32Array
    target: Float32Array
    weight: Float32Array


@njit(**KERNEL)
def batch_gradient(
    sizes: Sizes,
    vector: Float32Array,
    rows: Rows,
    chosen: NDArray[np.int64],
    values: Values,
    by: ByValues,
    gradient: Float32Array,
) -> float:
    """Write the gradient by ``vector``.

    Args:
        chosen: (batch,), which rows; ``values`` and ``by`` have room for them.

    Returns:
        the batch's mean of ``weight * error**2``.
    """
    original, batch = split(vector, sizes), len(chosen)
    weights, into = turned(sizes, original), split(gradient, sizes)
    blocks = (batch + LANES - 1) // LANES
    loss = 0.0
    for block in range(blocks):
        some = chosen[block * LANES : min((block + 1) * LANES, batch)]
        read(sizes, rows.images, rows.motions, some, block, values)
        run_block(sizes, weights, block, values)
        for lane in range(LANES):
            place, slope = block * LANES + lane, np.float32(0.0)
            if lane < len(some):
                error = values.wheel[place] - rows.target[some[lane]]
                weighted = rows.weight[some[lane]] * error
                loss += np.float64(weighted) * np.float64(error) / batch
                slope = np.float32(2.0) * weighted / np.float32(batch)
            by.wheel[place] = slope
    _by_wheel(sizes.hidden, blocks, original.wheel.weight, values, by, into)
    hidden, third, second = (
        inputs_together(sizes.hidden, original.hidden.weight),
        inputs_together(sizes.third, original.third.weight),
        inputs_together(sizes.second, original.second.weight),
    )
    for block in range(blocks):
        by_features = block_of(by.third, output_size(sizes.third), block)
        by_values(
            sizes.hidden, hidden, block_of(by.hidden, output_size(sizes.hidden), block), sizes.image,
            by_features,
        )  # fmt: skip
        features = block_of(values.features, input_size(sizes.hidden), block)
        _keep_positive(features[: len(by_features)], by_features)
        by_second = block_of(by.second, output_size(sizes.second), block)
        by_values(sizes.third, third, by_features, sizes.third.ins, by_second)
        _rectified(sizes.third, block_of(values.second, input_size(sizes.third), block), by_second)
        by_first = block_of(by.first, output_size(sizes.first), block)
        by_values(sizes.second, second, by_second, sizes.second.ins, by_first)
        _rectified(sizes.second, block_of(values.first, input_size(sizes.second), block), by_first)
    by_weights(
        sizes.hidden, blocks, values.features, by.hidden, into.hidden.weight, into.hidden.bias
    )
    by_weights(sizes.third, blocks, values.second, by.third, into.third.weight, into.third.bias)
    by_weights(sizes.second, blocks, values.first, by.second, into.second.weight, into.second.bias)
    by_weights(sizes.first, blocks, values.image, by.first, into.first.weight, into.first.bias)
    return loss


@njit(**KERNEL)
def inputs_together(layer: Layer, weight: Float32Array) -> Float32Array:
    """(outs * ins * taps,) -> (taps * outs * ins,), as ``by_values`` reads them."""
    count = layer.kernel * layer.kernel
    together = np.empty_like(weight)
    for out in range(layer.outs):
        for channel in range(layer.ins):
            for tap in range(count):
                value = weight[(out * layer.ins + channel) * count + tap]
                together[(tap * layer.outs + out) * layer.ins + channel] = value
    return together


@njit(**KERNEL)
def _by_wheel(
    hidden: Layer, blocks: int, wheel: Float32Array, values: Values, by: ByValues, into: Weights
) -> None:
    bias = np.float32(0.0)
    for place in range(blocks * LANES):
        bias += by.wheel[place]
    into.wheel.bias[0] = bias
    for unit in range(hidden.outs):
        total = np.float32(0.0)
        for block in range(blocks):
            start = (block * hidden.outs + unit) * LANES
            for lane in range(LANES):
                value, slope = values.hidden[start + lane], by.wheel[block * LANES + lane]
                total += value * slope
                by.hidden[start + lane] = (
                    wheel[unit] * slope if value > np.float32(0.0) else np.float32(0.0)
                )
        into.wheel.weight[unit] = total


@njit(**KERNEL)
def _rectified(after: Layer, values: Float32Array, by_out: Float32Array) -> None:
    """Set the gradient to 0 where a layer's output, the next one's input, was.

    Args:
        after: the layer that reads it.
        values: (input_size of ``after``,).
        by_out: (channels * rows * columns * LANES,), without the margin.
    """
    margin = after.kernel // 2
    rows, columns = inside(after)
    for channel in range(after.ins):
        for y in range(rows):
            for x in range(columns):
                held = ((channel * after.high + y + margin) * after.wide + x + margin) * LANES
                place = ((channel * rows + y) * columns + x) * LANES
                _keep_positive(values[held : held + LANES], by_out[place : place + LANES])


@njit(**KERNEL)
def _keep_positive(values: Float32Array, by_out: Float32Array) -> None:
    for place in range(len(by_out)):  # a choice and no branch, which would be guessed wrong
        slope = by_out[place]
        by_out[place] = slope if values[place] > np.float32(0.0) else np.float32(0.0)
