import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.errors import InvalidConfig

labels = arrays(np.float64, st.integers(2, 60), elements=st.floats(-2.5, 2.5))


def series(label: np.ndarray, rate_hz: float = 20.0, person: str = "p") -> LabelSeries:
    label = np.asarray(label, dtype=float)
    return LabelSeries(
        person=person,
        rollout="r",
        rate_hz=rate_hz,
        label=label,
        truth=np.zeros(len(label)),
        valid=np.isfinite(label),
    )


@settings(deadline=None)
@given(label=labels, control_hz=st.sampled_from([5.0, 10.0, 15.0, 20.0, 33.0, 50.0, 100.0]))
def test_the_centre_of_every_window_is_its_label(label: np.ndarray, control_hz: float):
    config = WindowConfig()
    windows = make_windows([series(label, control_hz)], config)
    assert windows.inputs.shape == (len(label), 21, 2)
    np.testing.assert_array_equal(windows.inputs[:, config.side, 0], label.astype(np.float32))
    assert (windows.inputs[:, config.side, 1] == 1.0).all()


@settings(deadline=None)
@given(label=labels, stride=st.integers(1, 4))
def test_whole_ratios_take_labels_as_given_and_nothing_from_outside(label, stride):
    config = WindowConfig()
    inputs = make_windows([series(label, 10.0 * stride)], config).inputs.numpy()
    for row in range(len(label)):
        for column in range(config.length):
            at = row + stride * (column - config.side)
            inside = 0 <= at < len(label)
            expected = (np.float32(label[at]), 1.0) if inside else (0.0, 0.0)
            assert tuple(inputs[row, column]) == expected


@pytest.mark.parametrize("control_hz", [7.0, 12.5, 16.0, 25.0, 64.0])
def test_other_rates_see_the_same_signal(control_hz: float):
    def signal(t_s):
        return np.sin(2.0 * t_s)

    config = WindowConfig()
    t_s = np.arange(int(8 * control_hz)) / control_hz
    inputs = make_windows([series(signal(t_s), control_hz)], config).inputs.numpy()
    sample_t_s = t_s[:, None] + np.arange(-config.side, config.side + 1) / config.rate_hz
    present = inputs[..., 1] == 1.0
    inside = (sample_t_s >= -1e-9) & (sample_t_s <= t_s[-1] + 1e-9)
    np.testing.assert_array_equal(present, inside)
    np.testing.assert_allclose(inputs[..., 0][present], signal(sample_t_s)[present], atol=0.012)


def test_series_do_not_leak_into_each_other():
    both = make_windows([series(np.full(30, 1.0)), series(np.full(30, 2.0))], WindowConfig())
    first, second = both.inputs[:30], both.inputs[30:]
    assert set(first[..., 0].unique().tolist()) == {0.0, 1.0}
    assert set(second[..., 0].unique().tolist()) == {0.0, 2.0}


def test_people_rates_and_rows_keep_their_order():
    parts = [series([1, 1], 20.0, "b"), series([2, 2, 2], 10.0, "a"), series([0, 0], 5.0, "b")]
    windows = make_windows(parts, WindowConfig())
    assert windows.people == ("b", "a")
    assert windows.person.tolist() == [0, 0, 1, 1, 1, 0, 0]
    assert windows.label.tolist() == [1, 1, 2, 2, 2, 0, 0]


def test_a_missing_label_is_marked_not_filled():
    windows = make_windows([series([1.0, np.nan, 1.0, 1.0], 10.0)], WindowConfig())
    assert torch.isnan(windows.label).tolist() == [False, True, False, False]
    assert not windows.valid[1]
    np.testing.assert_array_equal(windows.inputs[0, 10:14, 1], [1, 0, 1, 1])
    assert torch.isfinite(windows.inputs).all()


def test_a_sample_beside_a_missing_label_is_missing_too():
    windows = make_windows([series([1.0, 1.0, 1.0, np.nan, 1.0], 15.0)], WindowConfig())
    np.testing.assert_array_equal(windows.inputs[0, 10:14, 1], [1, 1, 0, 0])  # at 0, 1.5, 3, 4.5


def test_difference_is_label_minus_truth():
    one = LabelSeries(
        person="p",
        rollout="r",
        rate_hz=10.0,
        label=np.array([1.0, 0.5]),
        truth=np.array([0.25, 1.5]),
        valid=np.array([True, True]),
    )
    assert make_windows([one], WindowConfig()).difference.tolist() == [0.75, -1.0]


@pytest.mark.parametrize("rate_hz", [5.0, 20.0, 60.0, 12.7])
def test_a_window_in_steps_reads_the_table_step_by_step_at_any_rate(rate_hz):
    window = WindowConfig(half_width_steps=2)
    label = np.array([0.5, -1.0, 2.0, 0.25, 1.0, -0.5])
    cut = make_windows([series(label, rate_hz)], window)
    assert (window.length, window.span, str(window)) == (5, "5 steps", "±2 steps")
    assert window.reach_steps(rate_hz) == 2.0
    np.testing.assert_array_equal(cut.inputs[2, :, 0], label[:5].astype(np.float32))
    np.testing.assert_array_equal(cut.inputs[0, :, 1], [0, 0, 1, 1, 1])


def test_a_window_in_steps_may_not_look_ahead_by_seconds():
    for changes in ({"half_width_steps": 0}, {"half_width_steps": 2, "look_ahead_s": 0.5}):
        with pytest.raises(InvalidConfig, match=r"half_width_s|half_width_steps"):
            WindowConfig(**changes)
    one = WindowConfig(look_ahead_s=0.2)
    assert (one.span, one.reach_steps(20.0), str(one)) == (
        "2 s",
        20.0,
        "±1 s at 10 Hz, 0.2 s ahead",
    )


def test_no_series_and_impossible_windows_are_errors():
    with pytest.raises(InvalidLabels, match="at least one"):
        make_windows([], WindowConfig())
    for changes in ({"rate_hz": 0.0}, {"half_width_s": -1.0}, {"half_width_s": 0.01}):
        with pytest.raises(InvalidConfig):
            WindowConfig(**changes)
