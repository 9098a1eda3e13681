"""What a person's linear model sees of the labels around a sample."""

import numpy as np

from steerlab.learning.empirical_bayes.grid import RATE_HZ
from steerlab.sim.arrays import FloatArray
from steerlab.sim.rollout import BoolArray
from steerlab.sim.vehicle import WHEEL_LIMIT

HALF_WIDTH_S = 1.0
TAP_S = 0.1
CLIPPED_AT = WHEEL_LIMIT - 0.01  # a label at the stop says "at least"
_TAP_STEPS = round(TAP_S * RATE_HZ)
_SIDE = round(HALF_WIDTH_S / TAP_S)
_SMOOTHING = np.array([0.25, 0.5, 0.25])  # between taps: every sample counts once in two taps
TAPS = 2 * _SIDE + 1
NONLINEAR = ("m|m|", "tanh(m/.15)", "tanh(m/.5)", "m³", "at the stop")
FEATURES = TAPS + len(NONLINEAR) + 1
BIAS = FEATURES - 1  # the only feature that keeps its sign when left and right are exchanged


def label_features(label: FloatArray) -> FloatArray:
    """Features of each sample: labels (..., samples) -> (..., samples, FEATURES).

    Smoothed labels every ``TAP_S`` within ±``HALF_WIDTH_S`` (index ``TAPS // 2`` is the centre),
    odd non-linear functions of a label smoothed over 0.25 s, and 1. Beyond the ends labels are
    held; ``whole_window`` says where.
    """
    smooth = _smooth(label, _SMOOTHING)
    wide = _smooth(smooth, np.array([1.0, 1.0, 1.0]) / 3.0)
    columns = [shifted(smooth, _TAP_STEPS * tap) for tap in range(-_SIDE, _SIDE + 1)]
    columns += [
        wide * np.abs(wide),
        np.tanh(wide / 0.15),
        np.tanh(wide / 0.5),
        wide**3,
        np.sign(label) * at_stop(label),
        np.ones_like(label),
    ]
    return np.stack(columns, axis=-1)


def at_stop(label: FloatArray) -> BoolArray:
    """Where the wheel was as far as it goes: the label is censored there."""
    return np.abs(label) > CLIPPED_AT


def whole_window(present: BoolArray) -> BoolArray:
    """Where no label within ±``HALF_WIDTH_S`` is missing: (..., samples) -> (..., samples)."""
    reach = _SIDE * _TAP_STEPS + 1  # one more for the smoothing
    ends = [(0, 0)] * (present.ndim - 1) + [(reach + 1, reach)]
    missing = np.cumsum(np.pad(~present, ends, constant_values=True), axis=-1, dtype=np.int64)
    width = 2 * reach + 1
    return missing[..., width:] - missing[..., :-width] == 0


def shifted(values: FloatArray, ahead: int) -> FloatArray:
    """``values`` read ``ahead`` samples later along the last axis; the ends hold."""
    samples = values.shape[-1]
    return values[..., np.clip(np.arange(samples) + ahead, 0, samples - 1)]


def _smooth(values: FloatArray, kernel: np.ndarray) -> FloatArray:
    before, now, after = kernel
    return before * shifted(values, -1) + now * values + after * shifted(values, 1)
