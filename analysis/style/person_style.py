"""How one person corrects: the style metrics of each rollout, and over all of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable, flat, too_few
from steerlab.analysis.style.metrics import Amplitude, TimingMetrics, ZeroTruth, amplitude, timing
from steerlab.analysis.style.warping import WarpingMethod, warp
from steerlab.learning.series import LabelSeries, by_person
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

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
    result = partial(
        RolloutStyle, person=series.person, rollout=series.rollout, method=method, steps=len(step)
    )
    if missing := too_few(len(step), FEWEST_STEPS, "valid steps"):
        return result(distance=missing, amplitude=missing, timing=missing, timing_scaled=missing)
    path = warp(label, truth, method)
    size = amplitude(label, truth, path, zero_truth=zero_truth)
    result = partial(result, distance=path.distance, amplitude=size)
    if constant := flat("the labels", label) or flat("the truth", truth):
        return result(timing=constant, timing_scaled=constant)
    scaled_path = warp(_scaled(label), _scaled(truth))
    return result(
        timing=timing(step, path, rate_hz=series.rate_hz, latency_s=latency_s),
        timing_scaled=timing(step, scaled_path, rate_hz=series.rate_hz, latency_s=latency_s),
    )


def _scaled(signal: FloatArray) -> FloatArray:
    return (signal - signal.mean()) / signal.std()


@dataclass(frozen=True, kw_only=True, slots=True)
class PersonStyle:
    """Style of one person; a metric leaves out the rollouts in which it is not computable.

    Every rollout weighs the same. Amplitudes are means. Lags are medians, since one rollout whose
    path bends far moves a mean by more than people differ (``benchmarks/style.py``).

    Attributes:
        method: how labels were matched for all but ``lag_s``.
        amplitude: mean of D / path length, in wheel units; positive over-corrects.
        amplitude_total: mean of D.
        wrong_direction: mean share of labels on the wrong side of zero, 0 to 1.
        lag_s: median over rollouts of the median lag between scaled signals; positive is delayed.
            The metric to use.
        lag_plain_s: median over rollouts of the mean lag along the paper's path.
        vote: the paper's majority over the points of all rollouts: -1, 0 or 1.
        voted_lag_s: mean over rollouts of the majority's sign times the mean distance in time.
        rollouts: what all of it comes from.
    """

    person: str
    method: WarpingMethod
    amplitude: float | NotComputable
    amplitude_total: float | NotComputable
    wrong_direction: float | NotComputable
    lag_s: float | NotComputable
    lag_plain_s: float | NotComputable
    vote: int | NotComputable
    voted_lag_s: float | NotComputable
    rollouts: tuple[RolloutStyle, ...]


def person_style(
    series: Sequence[LabelSeries],
    *,
    method: WarpingMethod = "exact",
    zero_truth: ZeroTruth = "over",
    latency_s: float | None = None,
) -> PersonStyle:
    """Style of the one person whose series these are.

    Raises:
        InvalidConfig: no series, series of several people, one rollout twice, or an argument is
            outside what it may be.
    """
    people = {labels.person for labels in series}
    if len(people) != 1:
        raise InvalidConfig(f"Series of {sorted(people)}; give all series of one person.")
    names = [labels.rollout for labels in series]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidConfig(f"{people.pop()!r} has {twice[0]!r} twice; keep one attempt.")
    rollouts = tuple(
        rollout_style(labels, method=method, zero_truth=zero_truth, latency_s=latency_s)
        for labels in series
    )
    sizes = [style.amplitude for style in rollouts if isinstance(style.amplitude, Amplitude)]
    lags = [
        (style.timing, labels.rate_hz)
        for style, labels in zip(rollouts, series, strict=True)
        if isinstance(style.timing, TimingMetrics)
    ]
    timings_scaled = [style.timing_scaled for style in rollouts]
    scaled = [timing for timing in timings_scaled if isinstance(timing, TimingMetrics)]
    no_size = NotComputable(reason=_why([style.amplitude for style in rollouts]))
    no_lag = NotComputable(reason=_why(timings_scaled))
    late, early = sum(lag.late for lag, _ in lags), sum(lag.early for lag, _ in lags)
    return PersonStyle(
        person=series[0].person,
        method=method,
        amplitude=_mean([size.normalised for size in sizes], no_size),
        amplitude_total=_mean([size.total for size in sizes], no_size),
        wrong_direction=_mean([size.wrong_direction for size in sizes], no_size),
        lag_s=_median([lag.median_lag_s for lag in scaled], no_lag),
        lag_plain_s=_median([lag.lag_s for lag, _ in lags], no_lag),
        vote=(late > early) - (late < early) if lags else no_lag,
        voted_lag_s=_mean([lag.voted_lag_steps / rate for lag, rate in lags], no_lag),
        rollouts=rollouts,
    )


def people_styles(
    series: Sequence[LabelSeries],
    *,
    method: WarpingMethod = "exact",
    zero_truth: ZeroTruth = "over",
    latency_s: dict[str, float] | None = None,
) -> list[PersonStyle]:
    """Styles of all people, in the order in which they first appear.

    Args:
        latency_s: of each person's device, where it is known.

    Raises:
        InvalidConfig: see ``person_style``.
    """
    known = latency_s or {}
    return [
        person_style(rollouts, method=method, zero_truth=zero_truth, latency_s=known.get(person))
        for person, rollouts in by_person(series).items()
    ]


def _mean(values: list[float], otherwise: NotComputable) -> float | NotComputable:
    return float(np.mean(values)) if values else otherwise


def _median(values: list[float], otherwise: NotComputable) -> float | NotComputable:
    return float(np.median(values)) if values else otherwise


def _why(metrics: Sequence[object]) -> str:
    reasons = dict.fromkeys(m.reason for m in metrics if isinstance(m, NotComputable))
    return f"in none of {len(metrics)} rollouts; {'; '.join(reasons)}"
