"""A policy as the kernels see it: its layers, its weights in one vector, its values block by block."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.learning.kernels.fused import fma
from steerlab.learning.kernels.lanes import KERNEL, Float32Array
from steerlab.learning.policy import (
    IMAGE_SHAPE,
    MOTION_CENTRE,
    MOTION_SCALE,
    MOTION_SIZE,
    Frames,
    PolicyConfig,
)
from steerlab.learning.policy_kernels.layers import (
    Frame,
    Layer,
    convolution,
    dense,
    input_size,
    output_size,
    run_layer,
    terms,
)
from steerlab.learning.policy_kernels.products import LANES

_CHANNELS, _HIGH, _WIDE = IMAGE_SHAPE
_CENTRE = np.array(MOTION_CENTRE, dtype=np.float32)
_SCALE = np.array(MOTION_SCALE, dtype=np.float32)


class Sizes(NamedTuple):
    """The layers; without an image the first three are empty.

    Attributes:
        image: features of the image that the hidden layer reads, before those of the motion.
        motion: values of the car's own motion that it reads.
    """

    first: Layer
    second: Layer
    third: Layer
    hidden: Layer
    image: int
    motion: int


class LayerWeights(NamedTuple):
    """A layer's part of a vector: (outs * terms,), (outs,)."""

    weight: Float32Array
    bias: Float32Array


class Weights(NamedTuple):
    """A policy's parameters, or a gradient by them, in the order of its torch modules; views."""

    first: LayerWeights
    second: LayerWeights
    third: LayerWeights
    hidden: LayerWeights
    wheel: LayerWeights


class Values(NamedTuple):
    """What each layer reads, by block; made once, so that margins stay 0.

    Attributes:
        hidden: (blocks * hidden units * LANES,).
        wheel: (blocks * LANES,).
    """

    image: Float32Array
    first: Float32Array
    second: Float32Array
    features: Float32Array
    hidden: Float32Array
    wheel: Float32Array


@cache
def sizes_of(config: PolicyConfig) -> Sizes:
    """The layers of ``PolicyNetwork`` with this configuration."""
    nothing = Layer(0, 0, 0, 0, 0, 0, 0)
    first, second, third = nothing, nothing, nothing
    image = 0
    if config.inputs != "state":
        one, two, three = config.channels
        first = convolution(_CHANNELS, one, 5, _HIGH // 2, _WIDE // 2)
        second = convolution(one, two, 3, _HIGH // 4, _WIDE // 4)
        third = convolution(two, three, 3, _HIGH // 8, _WIDE // 8)
        image = three * third.rows * third.columns
    motion = MOTION_SIZE if config.inputs != "image" else 0
    return Sizes(first, second, third, dense(image + motion, config.hidden), image, motion)


def room_for(sizes: Sizes, blocks: int) -> Values:
    """Room for ``blocks`` times ``LANES`` observations."""
    floats = (
        input_size(sizes.first),
        input_size(sizes.second),
        input_size(sizes.third),
        input_size(sizes.hidden),
        output_size(sizes.hidden),
        LANES,
    )
    return Values(*(np.zeros(blocks * size, np.float32) for size in floats))


@njit(**KERNEL)
def split(vector: Float32Array, sizes: Sizes) -> Weights:
    """The parts of a network's parameters in one vector."""
    first, rest = _part(vector, sizes.first)
    second, rest = _part(rest, sizes.second)
    third, rest = _part(rest, sizes.third)
    hidden, rest = _part(rest, sizes.hidden)
    units = sizes.hidden.outs
    return Weights(first, second, third, hidden, LayerWeights(rest[:units], rest[units:]))


@njit(**KERNEL)
def _part(vector: Float32Array, layer: Layer) -> tuple[LayerWeights, Float32Array]:
    bias = layer.outs * terms(layer)
    return LayerWeights(vector[:bias], vector[bias : bias + layer.outs]), vector[
        bias + layer.outs :
    ]


@njit(**KERNEL)
def outputs_together(layer: Layer, weight: Float32Array) -> Float32Array:
    """(outs * terms,) -> (terms * outs,), as ``run_layer`` reads them."""
    count = terms(layer)
    turned = np.empty_like(weight)
    for out in range(layer.outs):
        for k in range(count):
            turned[k * layer.outs + out] = weight[out * count + k]
    return turned


@njit(**KERNEL)
def turned(sizes: Sizes, weights: Weights) -> Weights:
    """Every layer's weights as ``run_layer`` reads them."""
    return Weights(
        LayerWeights(outputs_together(sizes.first, weights.first.weight), weights.first.bias),
        LayerWeights(outputs_together(sizes.second, weights.second.weight), weights.second.bias),
        LayerWeights(outputs_together(sizes.third, weights.third.weight), weights.third.bias),
        LayerWeights(outputs_together(sizes.hidden, weights.hidden.weight), weights.hidden.bias),
        weights.wheel,
    )


@njit(**KERNEL)
def prepare(sizes: Sizes, vector: Float32Array) -> Weights:
    """A vector's weights as ``run_policy`` reads them; the rest are views of it."""
    return turned(sizes, split(vector, sizes))


@njit(**KERNEL)
def read(
    sizes: Sizes,
    images: Frames,
    motions: Float32Array,
    row: NDArray[np.int64],
    block: int,
    values: Values,
) -> None:
    """Lay up to ``LANES`` observations side by side; lanes without one are 0.

    Args:
        images: (observations, 3 * 16 * 32).
        motions: (observations, 5).
        row: which of them.
    """
    high, wide, margin = sizes.first.high, sizes.first.wide, sizes.first.kernel // 2
    start = block * input_size(sizes.first)
    for channel in range(sizes.first.ins):
        for y in range(_HIGH):
            for x in range(_WIDE):
                pixel = (channel * _HIGH + y) * _WIDE + x
                place = start + ((channel * high + y + margin) * wide + x + margin) * LANES
                for lane in range(len(row)):
                    value = np.float32(images[row[lane], pixel])
                    values.image[place + lane] = value * np.float32(1.0 / 127.5) - np.float32(1.0)
                for lane in range(len(row), LANES):
                    values.image[place + lane] = np.float32(0.0)
    start = block * input_size(sizes.hidden) + sizes.image * LANES
    for which in range(sizes.motion):
        for lane in range(LANES):
            value = np.float32(0.0)
            if lane < len(row):
                value = (motions[row[lane], which] - _CENTRE[which]) / _SCALE[which]
            values.features[start + which * LANES + lane] = value


@njit(**KERNEL)
def run_block(sizes: Sizes, weights: Weights, block: int, values: Values) -> None:
    """From what ``read`` laid out to the wheel, not clipped.

    Args:
        weights: of ``turned``.
    """
    first, second, third, hidden = sizes.first, sizes.second, sizes.third, sizes.hidden
    run_layer(
        first, weights.first.weight, weights.first.bias,
        _of(values.image, input_size(first), block),
        _of(values.first, input_size(second), block),
        Frame(second.high, second.wide, second.kernel // 2),
    )  # fmt: skip
    run_layer(
        second, weights.second.weight, weights.second.bias,
        _of(values.first, input_size(second), block),
        _of(values.second, input_size(third), block),
        Frame(third.high, third.wide, third.kernel // 2),
    )  # fmt: skip
    features = _of(values.features, input_size(hidden), block)
    run_layer(
        third, weights.third.weight, weights.third.bias,
        _of(values.second, input_size(third), block), features,
        Frame(third.rows, third.columns, 0),
    )  # fmt: skip
    units = _of(values.hidden, output_size(hidden), block)
    run_layer(hidden, weights.hidden.weight, weights.hidden.bias, features, units, Frame(1, 1, 0))
    wheel = _of(values.wheel, LANES, block)
    for lane in range(LANES):
        wheel[lane] = weights.wheel.bias[0]
    for unit in range(hidden.outs):
        for lane in range(LANES):
            wheel[lane] = fma(weights.wheel.weight[unit], units[unit * LANES + lane], wheel[lane])


@njit(**KERNEL)
def _of(values: Float32Array, size: int, block: int) -> Float32Array:
    return values[block * size : (block + 1) * size]


@njit(**KERNEL)
def run_policy(
    sizes: Sizes,
    weights: Weights,
    images: Frames,
    motions: Float32Array,
    values: Values,
    wheel: Float32Array,
    hidden: Float32Array,
) -> None:
    """Every observation's wheel, (rows,), and hidden layer, (rows, units); one block at a time.

    A row's result does not depend on how many there are, nor on which.

    Args:
        weights: of ``prepare``.
    """
    units = sizes.hidden.outs
    for start in range(0, len(wheel), LANES):
        stop = min(start + LANES, len(wheel))
        read(sizes, images, motions, np.arange(start, stop), 0, values)
        run_block(sizes, weights, 0, values)
        for lane in range(stop - start):
            wheel[start + lane] = values.wheel[lane]
            for unit in range(units):
                hidden[start + lane, unit] = values.hidden[unit * LANES + lane]
