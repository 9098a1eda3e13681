"""Eq. 3 by cases, lags by hand, and the undefined cases."""

import numpy as np
import pytest

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.style.metrics import amplitude, timing
from steerlab.analysis.style.person_style import rollout_style
from steerlab.analysis.style.warping import Warping
from steerlab.sim.errors import InvalidConfig


def path(label_index, truth_index):
    """A given path, whatever it costs."""
    return Warping(
        method="exact",
        distance=0.0,
        label_index=np.array(label_index),
        truth_index=np.array(truth_index),
    )


@pytest.mark.parametrize(
    ("label", "truth", "signed"),
    [
        (1.5, 1.0, 0.5),  # Eq. 3, first case: o > 0, a >= o
        (0.7, 1.0, -0.3),  # second: o > 0, a < o
        (-0.7, -1.0, -0.3),  # third: o < 0, a >= o
        (-1.5, -1.0, 0.5),  # fourth: o < 0, a < o
        (1.0, 1.0, 0.0),
        (-0.5, 1.0, -1.5),  # the wrong way counts as too little
        (0.5, -1.0, -1.5),
        (0.4, 0.0, 0.4),  # Eq. 3 says nothing of o = 0; any input is too much
        (-0.4, 0.0, 0.4),
        (0.0, 0.0, 0.0),
    ],
)
def test_equation_3(label, truth, signed):
    found = amplitude(np.array([label]), np.array([truth]), path([0], [0]))
    assert found.total == pytest.approx(signed)
    assert found.wrong_direction == float(label * truth < 0)
    assert found.zero_truth == float(truth == 0)


def test_amplitude_follows_the_path_and_is_divided_by_its_length():
    label, truth = np.array([2.0, 1.0]), np.array([1.0, -1.0])
    found = amplitude(label, truth, path([0, 1, 1], [0, 0, 1]))
    assert found.total == pytest.approx(1.0 + 0.0 - 2.0)
    assert found.normalised == pytest.approx(-1.0 / 3.0)
    assert found.wrong_direction == pytest.approx(1.0 / 3.0)
    assert found.points == 3


def test_zero_truth_can_be_skipped():
    label, truth, on = np.array([2.0, 0.5]), np.array([1.0, 0.0]), path([0, 1], [0, 1])
    over, skip = (amplitude(label, truth, on, zero_truth=how) for how in ("over", "skip"))
    assert (over.total, over.normalised, over.zero_truth) == (1.5, 0.75, 0.5)
    assert (skip.total, skip.normalised, skip.points) == (1.0, 1.0, 1)
    nothing = amplitude(label, np.zeros(2), on, zero_truth="skip")
    assert isinstance(nothing, NotComputable)
    assert "truth is 0 at every step" in nothing.reason
    with pytest.raises(InvalidConfig, match="zero_truth is 'ignore'"):
        amplitude(label, truth, on, zero_truth="ignore")  # pyright: ignore[reportArgumentType]


def test_a_label_matched_to_earlier_truth_is_late():
    found = timing(np.arange(4), path([0, 1, 2, 3, 3], [0, 0, 0, 1, 3]), rate_hz=20.0)
    assert found.lag_steps == pytest.approx(1.0)  # 0, 1, 2, 2, 0
    assert found.lag_s == pytest.approx(0.05)
    assert (found.late, found.early, found.vote) == (3, 0, 1)
    assert found.voted_lag_steps == pytest.approx(1.0)
    assert found.median_lag_s == pytest.approx(0.05)


def test_the_vote_counts_points_and_the_mean_weighs_them():
    """Three points a step early, one five steps late: early by majority, late on average."""
    found = timing(np.arange(9), path([0, 1, 2, 8], [1, 2, 3, 3]), rate_hz=20.0)
    assert (found.vote, found.lag_steps) == (-1, 0.5)
    assert found.voted_lag_steps == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("on", "vote"), [(path([0, 1], [0, 1]), 0), (path([0, 1, 1, 2], [0, 0, 2, 2]), 0)]
)
def test_a_tied_vote_is_zero(on, vote):
    found = timing(np.arange(3), on, rate_hz=20.0)
    assert (found.vote, found.voted_lag_steps) == (vote, 0.0)


def test_latency_is_subtracted_when_known():
    on = path([2, 3, 4], [0, 1, 2])
    known = timing(np.arange(5), on, rate_hz=20.0, latency_s=0.03)
    unknown = timing(np.arange(5), on, rate_hz=20.0)
    assert unknown.lag_s == pytest.approx(0.1)
    assert known.lag_s == pytest.approx(0.07)
    assert known.median_lag_s == pytest.approx(0.07)
    assert (unknown.latency_s, known.latency_s) == (None, 0.03)


def test_a_latency_below_half_a_step_makes_nobody_early():
    found = timing(np.arange(3), path([0, 1, 2], [0, 1, 2]), rate_hz=20.0, latency_s=0.02)
    assert (found.vote, found.early) == (0, 0)
    assert found.lag_s == pytest.approx(-0.02)


@pytest.mark.parametrize("latency_s", [-0.1, float("nan"), float("inf")])
def test_an_impossible_latency_is_refused(latency_s):
    with pytest.raises(InvalidConfig, match="latency_s is"):
        timing(np.arange(3), path([0], [0]), rate_hz=20.0, latency_s=latency_s)


def test_a_rollout_corrected_twice_too_far(truth, make_series):
    found = rollout_style(make_series(1.5 * truth, truth))
    assert found.amplitude.normalised > 0.05
    assert found.timing_scaled.lag_steps == pytest.approx(0.0)
    assert rollout_style(make_series(0.6 * truth, truth)).amplitude.normalised < -0.05


@pytest.mark.parametrize("steps", [-6, 6])
def test_a_shifted_rollout_has_that_lag(truth, make_series, steps):
    """The ends are matched to the ends, so a little is lost."""
    found = rollout_style(make_series(1.3 * np.roll(truth, steps)[10:-10], truth[10:-10]))
    assert found.timing_scaled.lag_steps == pytest.approx(steps, abs=0.7)
    assert found.timing_scaled.vote == np.sign(steps)


def test_masked_steps_are_left_out_and_keep_their_time(truth, make_series):
    """A gap of a second: labels 6 steps late stay 6 steps late on either side of it."""
    label = np.roll(truth, 6)
    gap = label.copy()
    gap[90:110] = np.nan
    whole, holed = (rollout_style(make_series(one, truth)) for one in (label, gap))
    assert (whole.steps, holed.steps) == (200, 180)
    assert holed.timing.lag_steps == pytest.approx(whole.timing.lag_steps, abs=2.0)
    at = np.array([0, 1, 30, 31])
    found = timing(at, path([0, 1, 2, 3], [0, 1, 1, 3]), rate_hz=20.0)
    assert found.lag_steps == pytest.approx(29 / 4)  # 30 - 1 control steps, not 2 - 1


def test_labels_that_never_change_have_an_amplitude_but_no_lag(truth, make_series):
    found = rollout_style(make_series(np.zeros(200), truth))
    assert found.amplitude.total == pytest.approx(-np.abs(truth).sum(), rel=0.3)
    assert isinstance(found.timing, NotComputable)
    assert "all values of the labels are 0" in found.timing.reason
    assert found.timing_scaled == found.timing


def test_too_few_valid_steps_have_no_style(make_series):
    found = rollout_style(make_series([1.0, np.nan, 2.0, 0.0], [1.0, 1.0, 1.0, np.nan]))
    assert found.steps == 2
    for metric in (found.distance, found.amplitude, found.timing, found.timing_scaled):
        assert isinstance(metric, NotComputable)
        assert "valid steps: 2" in metric.reason
