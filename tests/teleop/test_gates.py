import pytest

from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import GateConfig, LoopHealth, failed_gates

MS = 1_000_000


def timings(late_ns, ages_ns=None, period_ns=50 * MS):
    ages_ns = ages_ns or [None] * len(late_ns)
    return [
        StepTiming(
            deadline_ns=n * period_ns,
            actual_ns=n * period_ns + late,
            sample_ns=n * period_ns + late,
            event_age_ns=age,
            overrun=late > 16 * MS,
            focus=True,
            device_ok=True,
        )
        for n, (late, age) in enumerate(zip(late_ns, ages_ns, strict=True))
    ]


def test_a_good_attempt_breaks_no_gate():
    health = LoopHealth.of(timings([50_000] * 200, [MS] * 200), [6 * MS] * 600, dropped=0)
    assert health.lateness_p99_ms == pytest.approx(0.05)
    assert health.frame_p50_ms == pytest.approx(6.0)
    assert failed_gates(health, GateConfig()) == []


@pytest.mark.parametrize(
    ("late_ns", "dropped", "names"),
    [
        ([3 * MS] * 200, 0, ["lateness_p99_ms"]),
        ([0] * 199 + [11 * MS], 0, ["lateness_max_ms"]),
        ([0] * 199 + [40 * MS], 0, ["lateness_max_ms", "overrun_share"]),
        ([0] * 200, 6, ["dropped_share"]),
    ],
)
def test_each_gate_is_named_with_value_and_limit(late_ns, dropped, names):
    health = LoopHealth.of(timings(late_ns), [6 * MS] * 600, dropped=dropped)
    failed = failed_gates(health, GateConfig())
    assert [gate.name for gate in failed] == names
    assert all(gate.value > gate.limit for gate in failed)
    assert f"limit {failed[0].limit:g}" in str(failed[0])


def test_a_wheel_held_still_has_no_input_age():
    still = [n * 50 * MS for n in range(200)]  # the only event came at the start
    assert LoopHealth.of(timings([0] * 200, still), [], 0).input_age_p99_ms is None
    moving = LoopHealth.of(timings([0] * 200, [2 * MS] * 200), [], 0)
    assert moving.input_age_p99_ms == pytest.approx(2.0)
    slow = LoopHealth.of(timings([0] * 200, [20 * MS] * 200), [], 0)
    assert [gate.name for gate in failed_gates(slow, GateConfig())] == ["input_age_p99_ms"]
