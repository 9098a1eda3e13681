"""Eq. 2 and its gradient over a batch, block by block: a training step without autograd."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from numba import njit
from torch import Tensor

from steerlab.learning.kernels.halves import half_of, read_samples, run_halves
from steerlab.learning.kernels.heads import (
    Layers,
    Loss,
    heads_gradient,
    loss_gradient,
    run_heads,
)
from steerlab.learning.kernels.lanes import (
    KERNEL,
    LANES,
    Float32Array,
    copy,
    padded,
    transposed,
)
from steerlab.learning.kernels.lstm import BESIDE, lstm_gradient
from steerlab.learning.kernels.weights import Sizes, sizes_of, split
from steerlab.learning.mind_meld import MindMeld

IntArray = npt.NDArray[np.int64]


class Batch(NamedTuple):
    """Windows to train on.

    Attributes:
        inputs: (all windows, length, 2).
        row: (batch,), which of them.
        sign: (batch,), -1 to see a window left for right.
        target: (batch,), the true ``a - o``, its sign as in the windows seen.
        person: (batch,), rows of the embeddings.
        noise: (batch, d), standard normal, for the sample from g.
    """

    inputs: Float32Array
    row: IntArray
    sign: Float32Array
    target: Float32Array
    person: IntArray
    noise: Float32Array

    @classmethod
    def of(cls, *tensors: Tensor) -> "Batch":
        """The same from torch, in this order."""
        return cls(*(tensor.contiguous().numpy() for tensor in tensors))


class Room(NamedTuple):
    """Where a thread keeps one block's values; made once, so that it stays in the cache."""

    samples: Float32Array
    gates: tuple[Float32Array, Float32Array]  # past and future
    cells: tuple[Float32Array, Float32Array]
    hidden: Float32Array
    scratch: Float32Array
    steps_scratch: Float32Array
    values: Layers
    by: Layers

    @classmethod
    def of(cls, sizes: Sizes, length: int) -> "Room":
        """Room for windows of this many samples; torch aligns to cache lines, numpy does not."""

        def empty(*shape: int) -> Float32Array:
            return torch.empty(shape).numpy()

        rows, past = padded(sizes.units), length // 2 + 1
        both = (past, length - length // 2)
        return cls(
            samples=empty(length, 2 * LANES),
            gates=(empty(both[0], 4 * rows * LANES), empty(both[1], 4 * rows * LANES)),
            cells=(empty(both[0] + 1, rows * LANES), empty(both[1] + 1, rows * LANES)),
            hidden=empty(rows * LANES),
            scratch=empty(6 * rows * LANES),
            steps_scratch=empty((5 * rows + BESIDE) * past * LANES),
            values=Layers.zeros(sizes),
            by=Layers.zeros(sizes),
        )


class BatchGradient:
    """Eq. 2 and its gradient; a context, since it may hold threads.

    Blocks of windows are shared out between the threads, and their gradients are added in the
    order of the batch, so the number of threads changes no bit of a result.

    Args:
        network: whose sizes it is; its weights are given with each batch.
        loss: how to weigh.
        length: samples in a window.
        threads: as many blocks are computed at once.
    """

    def __init__(self, network: MindMeld, loss: Loss, length: int, threads: int) -> None:
        self._sizes, self._loss = sizes_of(network), loss
        self._rooms = [Room.of(self._sizes, length) for _ in range(threads)]
        self._pool = ThreadPoolExecutor(threads)
        self._by_block = torch.empty(0, 0)  # kept: fresh memory costs a twentieth of a batch

    def __enter__(self) -> "BatchGradient":
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()

    def __call__(
        self, batch: Batch, embeddings: Tensor, vector: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Gradients and losses.

        Args:
            batch: any number of windows.
            embeddings: (people, d).
            vector: of ``pack``.

        Returns:
            by the vector; by each window's embedding, (batch, d); the two losses' means, (2,).
        """
        blocks = -(-len(batch.row) // LANES)
        if self._by_block.shape != (blocks, len(vector)):
            self._by_block = torch.empty(blocks, len(vector))
        by_vector = self._by_block
        by_embedding = torch.empty(len(batch.row), embeddings.shape[1])
        losses = torch.empty(blocks, 2)
        threads = max(1, min(len(self._rooms), blocks))

        def run(thread: int) -> None:
            _blocks(
                self._sizes,
                self._loss,
                batch,
                embeddings.detach().numpy(),
                vector.detach().numpy(),
                self._rooms[thread],
                thread,
                threads,
                by_vector.numpy(),
                by_embedding.numpy(),
                losses.numpy(),
            )

        others = [self._pool.submit(run, thread) for thread in range(1, threads)]
        run(0)
        for other in others:
            other.result()
        return by_vector.sum(0), by_embedding, losses.sum(0)


@njit(**KERNEL)
def _blocks(
    sizes: Sizes,
    loss: Loss,
    batch: Batch,
    embeddings: Float32Array,
    vector: Float32Array,
    room: Room,
    first: int,
    stride: int,
    by_vector: Float32Array,
    by_embedding: Float32Array,
    losses: Float32Array,
) -> None:
    """Every ``stride``-th block from the ``first``: by_vector and losses have a row for each."""
    weights, rows = split(vector, sizes), padded(sizes.units)
    turned = (
        transposed(weights.past.by_hidden, rows),
        transposed(weights.future.by_hidden, rows),
    )
    size = sizes.units * LANES
    values, by = room.values, room.by
    for block in range(first, len(by_vector), stride):
        start = block * LANES
        stop = min(start + LANES, len(batch.row))
        read_samples(batch.inputs, batch.row[start:stop], batch.sign[start:stop], room.samples)
        run_halves(weights, room.samples, room.gates, room.cells, room.hidden, size, values.states)
        for r in range(stop - start):
            for dimension in range(sizes.embedding):
                value = embeddings[batch.person[start + r], dimension]
                values.f_input[(sizes.encoding + dimension) * LANES + r] = value
        run_heads(sizes, weights, values)
        gradient = split(by_vector[block], sizes)
        loss_gradient(
            sizes,
            loss,
            values,
            batch.target[start:stop],
            batch.noise[start:stop],
            len(batch.row),
            by,
            losses[block],
        )
        heads_gradient(sizes, weights, values, by, gradient)
        for r in range(stop - start):
            for dimension in range(sizes.embedding):
                value = by.f_input[(sizes.encoding + dimension) * LANES + r]
                by_embedding[start + r, dimension] = value
        halves = (gradient.past, gradient.future)
        for half in range(2):
            at, step, _ = half_of(half, batch.inputs.shape[1])
            room.hidden[size:] = np.float32(0.0)
            copy(by.states[half * size : (half + 1) * size], room.hidden)
            lstm_gradient(
                room.samples, at, step, turned[half], room.gates[half], room.cells[half],
                room.hidden, room.scratch, room.steps_scratch, halves[half],
            )  # fmt: skip
