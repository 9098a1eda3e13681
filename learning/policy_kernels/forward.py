"""From what is seen to the wheel, ``LANES`` observations at a time."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.learning.kernels.fused import fma
from steerlab.learning.kernels.lanes import KERNEL, Float32Array
from steerlab.learning.policy import IMAGE_SHAPE, MOTION_CENTRE, MOTION_SCALE, Frames
from steerlab.learning.policy_kernels.layers import Destination, input_size, output_size, run_layer
from steerlab.learning.policy_kernels.layout import Sizes, Values, Weights
from steerlab.learning.policy_kernels.products import LANES

_, _HIGH, _WIDE = IMAGE_SHAPE
_CENTRE = np.array(MOTION_CENTRE, dtype=np.float32)
_SCALE = np.array(MOTION_SCALE, dtype=np.float32)


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
        block_of(values.image, input_size(first), block),
        block_of(values.first, input_size(second), block),
        Destination(second.high, second.wide, second.kernel // 2),
    )  # fmt: skip
    run_layer(
        second, weights.second.weight, weights.second.bias,
        block_of(values.first, input_size(second), block),
        block_of(values.second, input_size(third), block),
        Destination(third.high, third.wide, third.kernel // 2),
    )  # fmt: skip
    features = block_of(values.features, input_size(hidden), block)
    run_layer(
        third, weights.third.weight, weights.third.bias,
        block_of(values.second, input_size(third), block), features,
        Destination(third.rows, third.columns, 0),
    )  # fmt: skip
    units = block_of(values.hidden, output_size(hidden), block)
    run_layer(
        hidden, weights.hidden.weight, weights.hidden.bias, features, units, Destination(1, 1, 0)
    )
    wheel = block_of(values.wheel, LANES, block)
    for lane in range(LANES):
        wheel[lane] = weights.wheel.bias[0]
    for unit in range(hidden.outs):
        for lane in range(LANES):
            wheel[lane] = fma(weights.wheel.weight[unit], units[unit * LANES + lane], wheel[lane])


@njit(**KERNEL)
def block_of(values: Float32Array, size: int, block: int) -> Float32Array:
    """One block's ``size`` values; a view."""
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
