"""One layer on ``LANES`` observations: a convolution of stride 2, or a dense layer as one of size 1.

Values lie flat, a channel after the other, each row by row, ``LANES`` observations side by side.
What a convolution reads has its margin of zeros around it, so no tap needs a test.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from steerlab.learning.kernels.lanes import KERNEL, Float32Array
from steerlab.learning.policy import TILE
from steerlab.learning.policy_kernels.products import (
    LANES,
    PATCH,
    add_products,
    outer_products,
)

STRIDE = 2
Places = NDArray[np.int64]


class Layer(NamedTuple):
    """Sizes; ``outs`` is a multiple of ``TILE``.

    Attributes:
        kernel: taps along each axis.
        rows: of the output.
        columns: of the output.
        high: rows of the input, margin included.
        wide: columns of the input, margin included.
    """

    ins: int
    outs: int
    kernel: int
    rows: int
    columns: int
    high: int
    wide: int


class Destination(NamedTuple):
    """Where a layer's output goes: the next layer's input, inside its margin."""

    high: int
    wide: int
    margin: int


def convolution(ins: int, outs: int, kernel: int, rows: int, columns: int) -> Layer:
    """A convolution of stride 2 whose output is (outs, rows, columns)."""
    high, wide = ((size - 1) * STRIDE + kernel for size in (rows, columns))
    return Layer(ins, outs, kernel, rows, columns, high, wide)


def dense(ins: int, outs: int) -> Layer:
    """A dense layer."""
    return convolution(ins, outs, 1, 1, 1)


@njit(**KERNEL)
def terms(layer: Layer) -> int:
    """Weights of one output."""
    return layer.ins * layer.kernel * layer.kernel


@njit(**KERNEL)
def input_size(layer: Layer) -> int:
    """float32 of one block's input."""
    return layer.ins * layer.high * layer.wide * LANES


@njit(**KERNEL)
def output_size(layer: Layer) -> int:
    """float32 of one block's output without a margin."""
    return layer.outs * layer.rows * layer.columns * LANES


@njit(**KERNEL)
def inside(layer: Layer) -> tuple[int, int]:
    """Rows and columns of the input without its margin."""
    if layer.kernel == 1:
        return 1, 1
    return STRIDE * layer.rows, STRIDE * layer.columns


@njit(**KERNEL)
def taps(layer: Layer) -> Places:
    """Where each weight of an output reads, from the output's corner in the input."""
    found = np.empty(terms(layer), np.int64)
    k = 0
    for channel in range(layer.ins):
        for y in range(layer.kernel):
            for x in range(layer.kernel):
                found[k] = ((channel * layer.high + y) * layer.wide + x) * LANES
                k += 1
    return found


@njit(**KERNEL)
def run_layer(
    layer: Layer,
    weights: Float32Array,
    bias: Float32Array,
    values: Float32Array,
    out: Float32Array,
    into: Destination,
) -> None:
    """Rectified output of one block.

    Args:
        weights: (terms * outs,), a term's outputs side by side; see ``outputs_together``.
        values: (input_size,).
        out: (outs * high * wide * LANES,) of ``into``.
    """
    places, area = taps(layer), into.high * into.wide * LANES
    for y in range(layer.rows):
        for x in range(layer.columns):
            corner = (STRIDE * y * layer.wide + STRIDE * x) * LANES
            place = ((y + into.margin) * into.wide + x + into.margin) * LANES
            for first in range(0, layer.outs, TILE):
                for c in range(first, first + TILE):
                    start = c * area + place
                    for lane in range(start, start + LANES):
                        out[lane] = bias[c]
                add_products(
                    weights, first, layer.outs, values, corner, places,
                    out, first * area + place, area,
                )  # fmt: skip
                for c in range(first, first + TILE):
                    start = c * area + place
                    for lane in range(start, start + LANES):
                        # this way round NaN stays NaN
                        out[lane] = np.float32(0.0) if out[lane] < np.float32(0.0) else out[lane]


@njit(**KERNEL)
def by_weights(
    layer: Layer,
    blocks: int,
    values: Float32Array,
    by_out: Float32Array,
    weights: Float32Array,
    bias: Float32Array,
) -> None:
    """Gradients by the weights, (outs * terms,), and by the bias, over all blocks.

    Args:
        values: (blocks * input_size,).
        by_out: (blocks * output_size,), by the output before it was rectified.
    """
    area, count = layer.rows * layer.columns, terms(layer)
    places = taps(layer)
    left_at = np.empty(blocks * area, np.int64)
    right_at = np.empty(blocks * area, np.int64)
    at = 0
    for block in range(blocks):
        for y in range(layer.rows):
            for x in range(layer.columns):
                corner = (STRIDE * y * layer.wide + STRIDE * x) * LANES
                left_at[at] = block * output_size(layer) + (y * layer.columns + x) * LANES
                right_at[at] = block * input_size(layer) + corner
                at += 1
    last = count - 1
    for k in range(0, count, PATCH):
        k0, k1, k2, k3 = k, min(k + 1, last), min(k + 2, last), min(k + 3, last)
        starts = (places[k0], places[k1], places[k2], places[k3])
        for row in range(0, layer.outs, PATCH):
            products = outer_products(
                by_out, row * area * LANES, area * LANES, left_at, values, starts, right_at
            )
            for index in range(PATCH * PATCH):
                column = k + index % PATCH
                if column <= last:
                    weights[(row + index // PATCH) * count + column] = products[index]
    sums = np.empty(LANES, np.float32)
    for c in range(layer.outs):
        sums[:] = np.float32(0.0)
        for place in left_at:
            start = place + c * area * LANES
            for lane in range(LANES):
                sums[lane] += by_out[start + lane]
        bias[c] = sums[0]
        for lane in range(1, LANES):
            bias[c] += sums[lane]


@njit(**KERNEL)
def by_values(
    layer: Layer, weights: Float32Array, by_out: Float32Array, ins: int, by_in: Float32Array
) -> None:
    """Gradient by the first ``ins`` input channels of one block, without the margin.

    Args:
        weights: (taps * outs * ins,), inputs side by side; see ``inputs_together``.
        by_out: (output_size,).
        by_in: (ins * rows * columns * LANES,).
    """
    margin, area = layer.kernel // 2, layer.rows * layer.columns
    high, wide = inside(layer)
    channels = np.arange(layer.outs) * (area * LANES)
    by_in[: ins * high * wide * LANES] = np.float32(0.0)
    for y in range(high):
        for x in range(wide):
            for row in range(layer.kernel):
                for column in range(layer.kernel):
                    above, before = y + margin - row, x + margin - column
                    if above < 0 or before < 0 or above % STRIDE or before % STRIDE:
                        continue
                    if above // STRIDE >= layer.rows or before // STRIDE >= layer.columns:
                        continue
                    place = (above // STRIDE * layer.columns + before // STRIDE) * LANES
                    tap = (row * layer.kernel + column) * layer.outs * layer.ins
                    for first in range(0, ins, TILE):
                        add_products(
                            weights, tap + first, layer.ins, by_out, place, channels,
                            by_in, (first * high * wide + y * wide + x) * LANES,
                            high * wide * LANES,
                        )  # fmt: skip
