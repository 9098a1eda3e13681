"""A label series at the mappers' own rate, with gaps bridged for filters and marked for everyone."""

from dataclasses import dataclass

import numpy as np

from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.rollout import BoolArray

RATE_HZ = 20.0  # of the shipped calibration set; other rates are read between steps
_TOLERANCE = 1e-6  # of a step: rounding only


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class GridSeries:
    """One person's labels for one rollout at ``RATE_HZ``.

    A filter needs a number at every sample, so ``label`` and ``truth`` bridge gaps linearly and
    hold their first and last value; whoever learns or scores looks at ``present`` and ``valid``.

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
