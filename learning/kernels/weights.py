"""MIND MELD's parameters as one vector, and as the matrices in it that the kernels read.

Matrices lie row by row and are padded with zeros to sizes that the tiles divide. Padding adds nothing and its gradient
is 0, so an optimiser may work on the whole vector.
"""

from collections.abc import Iterator
from typing import NamedTuple

import torch
from numba import njit
from torch import Tensor, nn

from steerlab.learning.kernels.lanes import KERNEL, Float32Array, padded
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.windows import CHANNELS
from steerlab.sim.errors import InvalidConfig

_GATES = 4


class Sizes(NamedTuple):
    """Of the three networks, without padding."""

    units: int  # of each LSTM
    encoding: int  # k
    embedding: int  # d
    hidden: int  # f's layer
    first: int  # g's layers
    second: int


class Lstm(NamedTuple):
    """One LSTM with torch's order of gates: (4 H * 2,), (4 H * H,), (4 H,), (4 H,)."""

    by_input: Float32Array
    by_hidden: Float32Array
    input_bias: Float32Array
    hidden_bias: Float32Array


class Dense(NamedTuple):
    """One layer: (out * in,), (out,)."""

    weight: Float32Array
    bias: Float32Array


class Weights(NamedTuple):
    """All of MIND MELD, in the order of its torch modules; as well the shape of a gradient."""

    past: Lstm
    future: Lstm
    encode: Dense
    f_hidden: Dense
    f_out: Dense
    g_first: Dense
    g_second: Dense
    g_last: Dense


def sizes_of(network: MindMeld) -> Sizes:
    """The sizes of its layers."""
    f = network.difference
    g = [layer for layer in network.inference.layers if isinstance(layer, nn.Linear)]
    encoding = network.encoder.to_encoding.out_features
    return Sizes(
        units=network.encoder.forward_lstm.hidden_size,
        encoding=encoding,
        embedding=f.hidden.in_features - encoding,
        hidden=f.hidden.out_features,
        first=g[0].out_features,
        second=g[1].out_features,
    )


def pack(network: MindMeld) -> Tensor:
    """A copy of the network's parameters as one vector.

    Raises:
        InvalidConfig: a parameter is not float32.
    """
    return torch.cat([_pad(*each).flatten() for each in _parameters(network)])


def unpack(vector: Tensor, network: MindMeld) -> None:
    """The inverse of ``pack``: set the network's parameters."""
    start = 0
    with torch.no_grad():
        for parameter, gates, channels in _parameters(network):
            shape = _pad(parameter, gates, channels).shape
            values = vector[start : start + shape.numel()].view(shape)
            start += shape.numel()
            inner = parameter.unflatten(0, (gates, -1))
            inner.copy_(values[tuple(slice(0, size) for size in inner.shape)])


def _parameters(network: MindMeld) -> Iterator[tuple[nn.Parameter, int, bool]]:
    """In the order of ``Weights``; into how many gates each is cut, whether columns are channels."""
    for module in network.modules():
        for name, parameter in module.named_parameters(recurse=False):
            if parameter.dtype != torch.float32:
                raise InvalidConfig(
                    f"The kernels compute in float32, and {name} is {parameter.dtype}; "
                    "call .float() on the network."
                )
            gates = _GATES if isinstance(module, nn.LSTM) else 1
            yield parameter, gates, name.startswith("weight_ih")


def _pad(parameter: Tensor, gates: int, channels: bool) -> Tensor:
    """(gates * m, n) -> (gates, padded m, padded n); channels stay as many as they are."""
    inner = parameter.detach().unflatten(0, (gates, -1))
    shape = [gates, *(padded(size) for size in inner.shape[1:])]
    if channels:
        shape[-1] = inner.shape[-1]
    wider = torch.zeros(shape)
    wider[tuple(slice(0, size) for size in inner.shape)] = inner
    return wider


@njit(**KERNEL)
def split(vector: Float32Array, sizes: Sizes) -> Weights:
    """The parts of a vector of ``pack``; views, nothing is copied."""
    units, hidden = padded(sizes.units), padded(sizes.hidden)
    encoding, second = padded(sizes.encoding), padded(sizes.second)
    past, rest = _lstm(vector, units)
    future, rest = _lstm(rest, units)
    encode, rest = _dense(rest, encoding, padded(2 * sizes.units))
    f_hidden, rest = _dense(rest, hidden, padded(sizes.encoding + sizes.embedding))
    f_out, rest = _dense(rest, padded(1), hidden)
    g_first, rest = _dense(rest, padded(sizes.first), padded(sizes.encoding + 1))
    g_second, rest = _dense(rest, second, padded(sizes.first))
    g_last, _ = _dense(rest, padded(2 * sizes.embedding), second)
    return Weights(past, future, encode, f_hidden, f_out, g_first, g_second, g_last)


@njit(**KERNEL)
def _lstm(vector: Float32Array, units: int) -> tuple[Lstm, Float32Array]:
    rows = _GATES * units
    hidden = rows * CHANNELS
    bias = hidden + rows * units
    weights = Lstm(
        vector[:hidden],
        vector[hidden:bias],
        vector[bias : bias + rows],
        vector[bias + rows : bias + 2 * rows],
    )
    return weights, vector[bias + 2 * rows :]


@njit(**KERNEL)
def _dense(vector: Float32Array, rows: int, columns: int) -> tuple[Dense, Float32Array]:
    bias = rows * columns
    return Dense(vector[:bias], vector[bias : bias + rows]), vector[bias + rows :]
