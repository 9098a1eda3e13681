"""What MIND MELD says of a single window, for streams: no others to lay beside it."""

from typing import NamedTuple

import numpy as np
import torch
from numba import njit
from torch import Tensor, nn

from steerlab.learning.kernels.fused import fma
from steerlab.learning.kernels.halves import half_of
from steerlab.learning.kernels.lanes import KERNEL, Float32Array, copy, sigmoid, tanh
from steerlab.learning.mind_meld import MindMeld

_ZERO = np.float32(0.0)


class _Lstm(NamedTuple):
    """Transposed, so that all gates are done at once: (2, 4 H), (H, 4 H), (4 H,)."""

    by_input: Float32Array
    by_hidden: Float32Array
    bias: Float32Array


class _Dense(NamedTuple):
    """Transposed: (in, out), (out,)."""

    weight: Float32Array
    bias: Float32Array


class OneWindow:
    """f for one person: a window in, the predicted difference out.

    Args:
        network: is copied.
        embedding: (d,), the person's w.
    """

    def __init__(self, network: MindMeld, embedding: Tensor) -> None:
        encoder, f = network.encoder, network.difference
        size = encoder.to_encoding.out_features
        with torch.no_grad():
            by_w = f.hidden.weight[:, size:] @ embedding  # the same for every window
            self._lstms = (_lstm(encoder.forward_lstm), _lstm(encoder.backward_lstm))
            self._encode = _dense(encoder.to_encoding.weight, encoder.to_encoding.bias)
            self._hidden = _dense(f.hidden.weight[:, :size], f.hidden.bias + by_w)
            self._out = _dense(f.out.weight, f.out.bias)

    def difference(self, window: Float32Array) -> float:
        """The predicted ``a - o`` at the centre of a window, (length, 2)."""
        return float(_difference(window, self._lstms, self._encode, self._hidden, self._out))


def _lstm(lstm: nn.LSTM) -> _Lstm:
    by_input, by_hidden, input_bias, hidden_bias = lstm.parameters()
    return _Lstm(_array(by_input.T), _array(by_hidden.T), _array(input_bias + hidden_bias))


def _dense(weight: Tensor, bias: Tensor) -> _Dense:
    return _Dense(_array(weight.T), _array(bias))


def _array(tensor: Tensor) -> Float32Array:
    return tensor.detach().float().clone(memory_format=torch.contiguous_format).numpy()


@njit(**KERNEL)
def _difference(
    window: Float32Array, lstms: tuple[_Lstm, _Lstm], encode: _Dense, hidden: _Dense, out: _Dense
) -> np.float32:
    units = len(lstms[0].by_hidden)
    states = np.empty(2 * units, np.float32)
    for half in range(2):
        first, stride, steps = half_of(half, len(window))
        own = states[half * units : (half + 1) * units]
        _run_lstm(window, first, stride, steps, lstms[half], own)
    encoding = _run_dense(encode, states)
    active = _run_dense(hidden, encoding)
    for unit in range(len(active)):
        active[unit] = max(active[unit], _ZERO)
    return _run_dense(out, active)[0]


@njit(**KERNEL)
def _run_lstm(
    window: Float32Array,
    first: int,
    stride: int,
    steps: int,
    lstm: _Lstm,
    hidden: Float32Array,
) -> None:
    """Leave the last hidden state, (H,), in ``hidden``."""
    units = len(hidden)
    z, cell = np.empty_like(lstm.bias), np.zeros(units, np.float32)
    hidden[:] = _ZERO
    for step in range(steps):
        copy(lstm.bias, z)
        _add(lstm.by_input, window[first + step * stride], z)
        if step > 0:
            _add(lstm.by_hidden, hidden, z)
        zi, zf, zg, zo = z[:units], z[units:], z[2 * units :], z[3 * units :]
        for unit in range(units):
            added = sigmoid(zi[unit]) * tanh(zg[unit])
            cell[unit] = fma(sigmoid(zf[unit]), cell[unit], added)
            hidden[unit] = sigmoid(zo[unit]) * tanh(cell[unit])


@njit(**KERNEL)
def _run_dense(layer: _Dense, values: Float32Array) -> Float32Array:
    out = np.empty_like(layer.bias)
    copy(layer.bias, out)
    _add(layer.weight, values, out)
    return out


@njit(**KERNEL)
def _add(weight: Float32Array, values: Float32Array, out: Float32Array) -> None:
    """``out += values @ weight``."""
    for row in range(len(values)):
        value, of_row = values[row], weight[row]
        for column in range(len(out)):
            out[column] = fma(value, of_row[column], out[column])
