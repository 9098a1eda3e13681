"""A label series at the mappers' own rate, and what a person's linear model sees of it.

Gaps are bridged for filters and marked for everyone.
"""

from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import CONTEXT, LabelSeries
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

RATE_HZ = 20.0  # of the shipped calibration set; other rates are read between steps
_TOLERANCE = 1e-6  # of a step: rounding only
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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class GridSeries:
    """One person's labels for one rollout at ``RATE_HZ``.

    A filter needs a number at every sample, so ``label`` and ``truth`` bridge gaps linearly and
    hold their first and last value; ``present`` and ``valid`` tell what is real.

    Attributes:
        label: (samples,) bridged; all 0 where nothing was ever labelled.
        present: (samples,) there is a label.
        truth: (samples,) bridged likewise.
        truth_present: (samples,) there is a truth.
        valid: (samples,) may train: label and truth are given and marked so.
    """

    label: FloatArray
    present: BoolArray
    truth: FloatArray
    truth_present: BoolArray
    valid: BoolArray

    @classmethod
    def from_series(cls, series: LabelSeries) -> "GridSeries":
        """Read ``series`` at ``RATE_HZ``; a sample between two steps needs both."""
        label, present = resample(series.label, series)
        truth, truth_present = resample(series.truth, series)
        marked, _ = resample(series.valid.astype(np.float64), series)
        return cls(
            label=label,
            present=present,
            truth=truth,
            truth_present=truth_present,
            valid=present & truth_present & (marked > 1.0 - _TOLERANCE),
        )


def grid_positions(series: LabelSeries) -> FloatArray:
    """Where the samples of the grid lie in ``series``, in its own steps, (samples,)."""
    ratio = series.rate_hz / RATE_HZ
    samples = int(np.floor((series.steps - 1) / ratio + _TOLERANCE)) + 1
    positions = ratio * np.arange(samples)
    whole = np.round(positions)
    return np.where(np.abs(positions - whole) < _TOLERANCE, whole, positions)


def resample(values: FloatArray, series: LabelSeries) -> tuple[FloatArray, BoolArray]:
    """Values (steps,) of ``series`` on the grid: (bridged, present), both (samples,)."""
    positions = grid_positions(series)
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(len(positions)), np.zeros(len(positions), dtype=bool)
    steps = np.arange(series.steps, dtype=np.float64)
    below = np.floor(positions).astype(np.int64)
    above = np.minimum(np.ceil(positions).astype(np.int64), series.steps - 1)
    return np.interp(positions, steps[known], values[known]), known[below] & known[above]


def from_grid(samples: FloatArray, series: LabelSeries) -> FloatArray:
    """Samples of the grid at the steps of ``series``, linear between and held beyond: (steps,)."""
    return np.interp(np.arange(series.steps, dtype=np.float64), grid_positions(series), samples)


def motion_on_grid(series: LabelSeries) -> FloatArray:
    """The car's motion on the grid, (samples, 3), columns as ``series.CONTEXT``.

    Raises:
        InvalidLabels: the series does not carry it.
    """
    missing = [name for name in CONTEXT if name not in series.context_names]
    if missing:
        raise InvalidLabels(
            f"Series of {series.person!r} on {series.rollout!r} has no {', '.join(missing)}; "
            "record the car's motion or use sim_pretrained, which reads labels only."
        )
    positions, steps = grid_positions(series), np.arange(series.steps, dtype=np.float64)
    columns = [series.context[:, series.context_names.index(name)] for name in CONTEXT]
    return np.column_stack([np.interp(positions, steps, column) for column in columns])


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
    """Where the wheel was at its limit, so that the label is censored."""
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
