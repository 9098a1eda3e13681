"""True parameters of simulated teachers in the place of the calibrated style w."""

import numpy as np

from steerlab.learning.pretrained.style import SIGNED, STYLE_SIZE
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.sim.arrays import FloatArray

_CENTRE = np.array([0.0, 0.12, 0.15, 0.1, 0.0, np.log(0.17), 0.2])  # by ``STYLE``
_SPREAD = np.array([0.45, 0.22, 0.06, 0.1, 0.1, 0.6, 0.08])
_SLOTS = [0, 1, 2, 3, SIGNED[0], 4, 5]


def known_style(parameters: FloatArray) -> FloatArray:
    """True parameters (..., len(STYLE)) in the place of w, (..., STYLE_SIZE)."""
    style = np.zeros((*parameters.shape[:-1], STYLE_SIZE))
    style[..., _SLOTS] = (parameters - _CENTRE) / _SPREAD
    return style


def known_readout() -> FloatArray:
    """The inverse of ``known_style`` as a linear readout, (1 + STYLE_SIZE, len(STYLE))."""
    readout = np.zeros((1 + STYLE_SIZE, len(STYLE)))
    readout[0] = _CENTRE
    for column, slot in enumerate(_SLOTS):
        readout[1 + slot, column] = _SPREAD[column]
    return readout
