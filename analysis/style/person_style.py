"""How one person corrects: the style metrics over all rollouts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.style.metrics import Amplitude, TimingMetrics, ZeroTruth
from steerlab.analysis.style.rollout_style import RolloutStyle, rollout_style
from steerlab.analysis.style.warping import WarpingMethod
from steerlab.learning.series import LabelSeries
from steerlab.sim.errors import InvalidConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class PersonStyle:
    """Style of one person; rollouts in which a metric is not computable do not count in it.

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
    people = {one.person for one in series}
    if len(people) != 1:
        raise InvalidConfig(f"Series of {sorted(people)}; give all series of one person.")
    names = [one.rollout for one in series]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidConfig(f"{people.pop()!r} has {twice[0]!r} twice; keep one attempt.")
    rollouts = tuple(
        rollout_style(one, method=method, zero_truth=zero_truth, latency_s=latency_s)
        for one in series
    )
    sizes = [one.amplitude for one in rollouts if isinstance(one.amplitude, Amplitude)]
    plain = [(one.timing, at) for one, at in zip(rollouts, series, strict=True)]
    lags = [(one, at.rate_hz) for one, at in plain if isinstance(one, TimingMetrics)]
    scaled = [one.timing_scaled for one in rollouts if isinstance(one.timing_scaled, TimingMetrics)]
    no_size = NotComputable(reason=_why([one.amplitude for one in rollouts]))
    no_lag = NotComputable(reason=_why([one.timing_scaled for one in rollouts]))
    late, early = sum(one.late for one, _ in lags), sum(one.early for one, _ in lags)
    return PersonStyle(
        person=series[0].person,
        method=method,
        amplitude=_mean([one.normalised for one in sizes], no_size),
        amplitude_total=_mean([one.total for one in sizes], no_size),
        wrong_direction=_mean([one.wrong_direction for one in sizes], no_size),
        lag_s=_median([one.median_lag_s for one in scaled], no_lag),
        lag_plain_s=_median([one.lag_s for one, _ in lags], no_lag),
        vote=(late > early) - (late < early) if lags else no_lag,
        voted_lag_s=_mean([one.voted_lag_steps / rate for one, rate in lags], no_lag),
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
        latency_s: of each person's device; who is not in it has an unknown one.

    Raises:
        InvalidConfig: see ``person_style``.
    """
    of: dict[str, list[LabelSeries]] = {}
    for one in series:
        of.setdefault(one.person, []).append(one)
    known = latency_s or {}
    return [
        person_style(mine, method=method, zero_truth=zero_truth, latency_s=known.get(person))
        for person, mine in of.items()
    ]


def _mean(values: list[float], otherwise: NotComputable) -> float | NotComputable:
    return float(np.mean(values)) if values else otherwise


def _median(values: list[float], otherwise: NotComputable) -> float | NotComputable:
    return float(np.median(values)) if values else otherwise


def _why(found: Sequence[object]) -> str:
    reasons = dict.fromkeys(one.reason for one in found if isinstance(one, NotComputable))
    return f"in none of {len(found)} rollouts; {'; '.join(reasons)}"
