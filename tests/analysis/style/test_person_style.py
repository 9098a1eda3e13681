"""A person's style over rollouts, and what is left when rollouts are unusable."""

import numpy as np
import pytest

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.style.person_style import people_styles, person_style
from steerlab.sim.errors import InvalidConfig


def _delayed(truth, steps):
    return np.concatenate([np.full(steps, truth[0]), truth])[: len(truth)]


def test_rollouts_weigh_the_same(truth, make_series):
    long, short = make_series(1.5 * truth, truth), make_series(truth[:50], truth[:50], rollout="b")
    found = person_style([long, short])
    parts = [one.amplitude.normalised for one in found.rollouts]
    assert found.amplitude == pytest.approx(np.mean(parts))
    assert found.amplitude_total == pytest.approx(
        np.mean([one.amplitude.total for one in found.rollouts])
    )


def test_the_lag_is_a_median(truth, make_series):
    """One wild rollout of three does not move it."""
    series = [
        make_series(_delayed(truth, steps), truth, rollout=f"r{steps}") for steps in (4, 5, 40)
    ]
    found = person_style(series)
    lags = [one.timing_scaled.median_lag_s for one in found.rollouts]
    assert found.lag_s == pytest.approx(lags[1])
    assert found.lag_s == pytest.approx(0.25, abs=0.05)
    assert (found.vote, found.voted_lag_s > 0) == (1, True)


def test_an_unusable_rollout_does_not_count_and_is_kept(truth, make_series):
    good = make_series(_delayed(1.2 * truth, 4), truth)
    still = make_series(np.zeros(200), truth, rollout="still")
    empty = make_series(np.full(200, np.nan), truth, rollout="empty")
    both, alone = person_style([good, still, empty]), person_style([good])
    assert both.lag_s == alone.lag_s
    assert both.amplitude < alone.amplitude  # `still` under-corrects; `empty` says nothing
    assert [one.rollout for one in both.rollouts] == ["one", "still", "empty"]


def test_nothing_usable_says_why(truth, make_series):
    found = person_style([make_series(np.full(200, np.nan), truth)])
    for metric in (found.amplitude, found.lag_s, found.vote, found.voted_lag_s):
        assert isinstance(metric, NotComputable)
        assert metric.reason == "in none of 1 rollouts; valid steps: 0; at least 4 are needed"


def test_latency_is_each_persons_own(truth, make_series):
    series = [make_series(_delayed(truth, 6), truth, person=person) for person in ("p-02", "p-01")]
    plain = people_styles(series)
    known = people_styles(series, latency_s={"p-01": 0.1})
    assert [one.person for one in known] == ["p-02", "p-01"]
    assert known[0].lag_s == plain[0].lag_s
    assert known[1].lag_s == pytest.approx(plain[1].lag_s - 0.1)


def test_both_methods_are_recorded(truth, make_series):
    series = [make_series(_delayed(1.4 * truth, 3), truth)]
    exact, fast = (person_style(series, method=method) for method in ("exact", "fastdtw"))
    assert (exact.method, fast.method) == ("exact", "fastdtw")
    assert fast.lag_s == exact.lag_s  # the scaled path is always exact
    assert fast.amplitude == pytest.approx(exact.amplitude, rel=0.02)


def test_series_of_several_people_are_refused(truth, make_series):
    one, other = make_series(truth, truth), make_series(truth, truth, person="p-02")
    with pytest.raises(InvalidConfig, match=r"p-01.*p-02"):
        person_style([one, other])
    with pytest.raises(InvalidConfig, match="twice; keep one attempt"):
        person_style([one, one])
    with pytest.raises(InvalidConfig, match="one person"):
        person_style([])
