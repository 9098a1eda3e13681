"""How the kernels lay out a policy: its layers, its weights in one vector, its values by block."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from steerlab.learning.kernels.lanes import KERNEL, Float32Array
from steerlab.learning.policy import (
    IMAGE_SHAPE,
    MOTION_SIZE,
    PolicyConfig,
)
from steerlab.learning.policy_kernels.layers import (
    Layer,
    convolution,
    dense,
    input_size,
    output_size,
    terms,
)
from steerlab.learning.policy_kernels.products import LANES

_CHANNELS, _HIGH, _WIDE = IMAGE_SHAPE


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
