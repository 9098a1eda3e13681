"""Style of one rollout: Eq. 3's signed amplitude, and lag, along a warping path."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.style.warping import IntArray, Warping
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

ZeroTruth = Literal["over", "skip"]
"""What a label is where the truth is 0, which Eq. 3 leaves open: any input is over-correction, or
the point does not count."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Amplitude:
    """Eq. 3: positive over-corrects, negative under-corrects.

    A label on the wrong side of zero is closer to no correction than to too much of one, and Eq. 3
    counts it as under-correction; ``wrong_direction`` tells how much of ``total`` may be that.

    Attributes:
        total: D, the signed sum of |label - truth| along the path; it grows with the path.
        normalised: D a point of the path, in wheel units.
        wrong_direction: share of points whose label and truth have opposite signs, 0 to 1.
        zero_truth: share of points whose truth is 0.
        points: how many points of the path count.
    """

    total: float
    normalised: float
    wrong_direction: float
    zero_truth: float
    points: int


@dataclass(frozen=True, kw_only=True, slots=True)
class TimingMetrics:
    """When labels come: positive is delayed, negative is anticipatory.

    Attributes:
        lag_steps: mean of (label's step - truth's step) along the path, less the latency.
        lag_s: the same in seconds.
        median_lag_s: the median along the path, less the latency; a path that bends to match
            heights moves it less than the mean.
        late, early: points of the path whose label comes after, before its truth.
        vote: the paper's majority: 1 if more points are late, -1 if more are early, 0 if equal.
        voted_lag_steps: ``vote`` times the mean number of steps between label and truth.
        latency_s: of the device, subtracted from the lags; None if it is not known, and the lags
            then contain it.
    """

    lag_steps: float
    lag_s: float
    median_lag_s: float
    late: int
    early: int
    vote: int
    voted_lag_steps: float
    latency_s: float | None


def amplitude(
    label: FloatArray, truth: FloatArray, warping: Warping, *, zero_truth: ZeroTruth = "over"
) -> Amplitude | NotComputable:
    """Eq. 3 along the path.

    Args:
        label: (n,) in wheel units.
        truth: (m,).

    Raises:
        InvalidConfig: ``zero_truth`` is unknown.
    """
    if zero_truth not in get_args(ZeroTruth):
        raise InvalidConfig(f"zero_truth is {zero_truth!r}; choose {get_args(ZeroTruth)}.")
    a, o = label[warping.label_index], truth[warping.truth_index]
    zero = o == 0.0
    if zero_truth == "skip":
        a, o, zero = a[~zero], o[~zero], zero[~zero]
    if len(o) == 0:
        return NotComputable(reason="the truth is 0 at every step and such steps are skipped")
    # Eq. 3's x by cases: beyond the truth, on its side of zero, adds; else it subtracts.
    over = np.where(o > 0.0, a >= o, a < o) | zero
    total = float(np.where(over, 1.0, -1.0) @ np.abs(a - o))
    return Amplitude(
        total=total,
        normalised=total / len(o),
        wrong_direction=float(np.mean(a * o < 0.0)),
        zero_truth=float(np.mean(zero)),
        points=len(o),
    )


def timing(
    step: IntArray, warping: Warping, *, rate_hz: float, latency_s: float | None = None
) -> TimingMetrics:
    """Lags along the path.

    A path counts whole steps, so the vote takes off the latency's nearest whole number of them:
    a latency of a third of a step would else make every punctual label early.

    Args:
        step: (n,) the control step of each label and of each truth.
        rate_hz: control rate.
        latency_s: of the device; None if it is not known.

    Raises:
        InvalidConfig: the latency is negative or not finite.
    """
    if latency_s is not None and not 0.0 <= latency_s < np.inf:
        raise InvalidConfig(f"latency_s is {latency_s}; give None or a time of at least 0.")
    latency_steps = (latency_s or 0.0) * rate_hz
    lag = step[warping.label_index] - step[warping.truth_index]
    whole = lag - round(latency_steps)
    late, early = int((whole > 0).sum()), int((whole < 0).sum())
    vote = (late > early) - (late < early)
    lag_steps = float(lag.mean()) - latency_steps
    return TimingMetrics(
        lag_steps=lag_steps,
        lag_s=lag_steps / rate_hz,
        median_lag_s=(float(np.median(lag)) - latency_steps) / rate_hz,
        late=late,
        early=early,
        vote=vote,
        voted_lag_steps=vote * float(np.abs(whole).mean()),
        latency_s=latency_s,
    )
