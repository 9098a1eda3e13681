"""How one person corrected one rollout."""

from dataclasses import dataclass

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable, flat, too_few
from steerlab.analysis.style.metrics import Amplitude, TimingMetrics, ZeroTruth, amplitude, timing
from steerlab.analysis.style.warping import WarpingMethod, warp
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray

FEWEST_STEPS = 4


@dataclass(frozen=True, kw_only=True, slots=True)
class RolloutStyle:
    """Style metrics of one series.

    Attributes:
        method: how labels were matched for ``amplitude`` and ``timing``.
        steps: valid ones, which alone count.
        distance: the DTW distance by ``method``, in wheel units.
        amplitude: Eq. 3.
        timing: along the same path, as in the paper. Where labels are larger than the truth this
            path bends away from the clock to match heights, which shows as lag.
        timing_scaled: along the exact path between both signals scaled to mean 0 and variance 1,
            so that gain and bias do not pass for lag. Ours, not the paper's.
    """

    person: str
    rollout: str
    method: WarpingMethod
    steps: int
    distance: float | NotComputable
    amplitude: Amplitude | NotComputable
    timing: TimingMetrics | NotComputable
    timing_scaled: TimingMetrics | NotComputable


def rollout_style(
    series: LabelSeries,
    *,
    method: WarpingMethod = "exact",
    zero_truth: ZeroTruth = "over",
    latency_s: float | None = None,
) -> RolloutStyle:
    """Style metrics of one person on one rollout.

    Masked steps are left out of both signals, never filled; lags count control steps, so a gap
    does not shorten them. Labels that never change have an amplitude but no lag.

    Raises:
        InvalidConfig: an argument is outside what it may be.
    """
    step = np.flatnonzero(series.valid)
    label, truth = series.label[step], series.truth[step]
    if few := too_few(len(step), FEWEST_STEPS, "valid steps"):
        return _result(series, method, len(step), few, few, few, few)
    warping = warp(label, truth, method)
    found = amplitude(label, truth, warping, zero_truth=zero_truth)
    if constant := flat("the labels", label) or flat("the truth", truth):
        return _result(series, method, len(step), warping.distance, found, constant, constant)
    scaled = warp(_scaled(label), _scaled(truth))
    return _result(
        series,
        method,
        len(step),
        warping.distance,
        found,
        timing(step, warping, rate_hz=series.rate_hz, latency_s=latency_s),
        timing(step, scaled, rate_hz=series.rate_hz, latency_s=latency_s),
    )


def _scaled(signal: FloatArray) -> FloatArray:
    return (signal - signal.mean()) / signal.std()


def _result(
    series: LabelSeries,
    method: WarpingMethod,
    steps: int,
    distance: float | NotComputable,
    found: Amplitude | NotComputable,
    plain: TimingMetrics | NotComputable,
    scaled: TimingMetrics | NotComputable,
) -> RolloutStyle:
    return RolloutStyle(
        person=series.person,
        rollout=series.rollout,
        method=method,
        steps=steps,
        distance=distance,
        amplitude=found,
        timing=plain,
        timing_scaled=scaled,
    )
