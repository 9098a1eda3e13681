import gc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidConfig
from steerlab.teleop.pacing import PacingConfig, WallClock, no_garbage_collection

MS = 1_000_000


class Time:
    """Time that passes only when something is done with it."""

    def __init__(self):
        self.ns = 12_345
        self.polls = []

    def now_ns(self):
        self.ns += 1_000  # looking at the clock takes a microsecond
        return self.ns

    def sleep_s(self, seconds):
        self.ns += round(seconds * 1e9) + 60_000  # sleep wakes 60 µs late

    def poll(self):
        self.polls.append(self.ns)


def make(**settings):
    time = Time()
    clock = WallClock(PacingConfig(**settings), time.poll, now_ns=time.now_ns, sleep_s=time.sleep_s)
    clock.start()
    return time, clock


def test_deadlines_are_a_whole_number_of_periods_apart():
    _, clock = make()
    ticks = [clock.wait_for(step, None) for step in range(200)]
    assert [tick.deadline_ns - ticks[0].deadline_ns for tick in ticks] == [
        step * 50 * MS for step in range(200)
    ]
    late = [tick.actual_ns - tick.deadline_ns for tick in ticks]
    assert min(late) >= 0
    assert max(late) < 0.1 * MS


def test_input_is_polled_every_millisecond_and_right_before_a_step():
    time, clock = make()
    clock.wait_for(0, None)
    gaps = [b - a for a, b in zip(time.polls, time.polls[1:], strict=False)]
    assert max(gaps) < 1.7 * MS
    assert time.ns - time.polls[-1] < 0.01 * MS


def test_a_display_frame_every_third_of_a_step():
    time, clock = make()
    shown = []

    def show(fraction):
        shown.append((fraction, time.ns))
        time.ns += 5 * MS

    deadlines = [clock.wait_for(step, show).deadline_ns for step in range(3)]
    assert [fraction for fraction, _ in shown] == pytest.approx([0, 1 / 3, 2 / 3] * 3)
    for (fraction, at_ns), deadline_ns in zip(
        shown, [deadline for deadline in deadlines for _ in range(3)], strict=True
    ):
        due_ns = deadline_ns - 50 * MS * (1 - fraction)
        assert 0 <= at_ns - due_ns < 0.2 * MS
    assert clock.dropped == 0
    assert [round(ns / MS) for ns in clock.frame_ns] == [5] * 9


def test_frames_that_would_make_a_step_late_are_left_out():
    time, clock = make()

    def slow(fraction):
        time.ns += 24 * MS

    late = []
    for step in range(40):
        tick = clock.wait_for(step, slow)
        late.append(tick.actual_ns - tick.deadline_ns)
    assert clock.dropped > 0
    assert len(clock.frame_ns) + clock.dropped == 120
    assert max(late[1:]) < 0.1 * MS  # once it is known how slow frames are


def test_a_long_freeze_loses_frames_and_never_steps():
    time, clock = make()
    shown = []
    ticks = []
    for step in range(20):
        if step == 5:
            time.ns += 400 * MS
        ticks.append(clock.wait_for(step, shown.append))
    assert [tick.deadline_ns - ticks[0].deadline_ns for tick in ticks] == [
        step * 50 * MS for step in range(20)
    ]
    assert ticks[5].actual_ns - ticks[5].deadline_ns > 300 * MS
    assert ticks[19].actual_ns - ticks[19].deadline_ns < 0.1 * MS
    assert clock.dropped >= 18


@given(slow=st.lists(st.integers(0, 120), min_size=10, max_size=40))
def test_whatever_frames_take_no_step_comes_early_or_twice(slow):
    time, clock = make()
    costs = iter(slow * 12)

    def show(fraction):
        time.ns += next(costs) * MS

    before = -1
    for step in range(len(slow)):
        tick = clock.wait_for(step, show)
        assert tick.actual_ns >= tick.deadline_ns > before
        before = tick.deadline_ns
    assert len(clock.frame_ns) + clock.dropped == 3 * len(slow)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"display_hz": 50.0}, "no multiple"),
        ({"display_hz": 10.0}, "no multiple"),
        ({"control_hz": 0.0}, "positive"),
        ({"poll_s": float("nan")}, "positive"),
    ],
)
def test_rates_that_do_not_fit_are_refused(settings, says):
    with pytest.raises(InvalidConfig, match=says):
        PacingConfig(**settings)


def test_no_garbage_is_collected_in_the_block():
    with no_garbage_collection():
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
