"""One contract for every teacher; properties of the scripted ones."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.populations import sample_population
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherNotReady, TeacherStyle
from steerlab.sim.teachers import Teacher
from steerlab.sim.vehicle import WHEEL_LIMIT

NOISY = TeacherStyle(
    gain=1.4,
    delay_s=0.17,
    lag_s=0.12,
    dead_zone=0.05,
    constant_noise=0.05,
    signal_noise=0.2,
    noise_time_s=0.2,
    bias=0.1,
    drift=0.01,
)


def respond(style: TeacherStyle, rollout: Rollout, *, order: int = 0, seed: int = 3) -> FloatArray:
    return ScriptedTeacher("t", style, seed).respond(rollout, order=order, attempt=0)


TEACHERS: dict[str, Callable[[], Teacher]] = {
    "perfect": lambda: ScriptedTeacher("perfect", TeacherStyle(), 0),
    "noisy": lambda: ScriptedTeacher("noisy", NOISY, 1),
    "paper": lambda: sample_population("paper", 1, 0, prefix="t")[0],
    "low": lambda: sample_population("low", 1, 0, prefix="t")[0],
    "human": lambda: sample_population("human", 1, 0, prefix="t")[0],
    "high": lambda: sample_population("high", 1, 0, prefix="t")[0],
    "people": lambda: sample_population("people", 1, 0, prefix="t")[0],
    "sparse": lambda: sample_population("sparse", 1, 0, prefix="t")[0],
}


@pytest.fixture(params=TEACHERS, name="make_teacher")
def _make_teacher(request: pytest.FixtureRequest) -> Callable[[], Teacher]:
    return TEACHERS[request.param]


class TestContract:
    def test_labels_are_finite_and_within_the_wheel(
        self, make_teacher: Callable[[], Teacher], waves
    ):
        teacher, rollout = make_teacher(), waves()
        teacher.begin(rollout, order=0, attempt=0)
        labels = [teacher.label(step) for step in range(rollout.steps)]
        assert all(isinstance(label, float) for label in labels)
        assert max(abs(label) for label in labels if label is not None) <= WHEEL_LIMIT

    def test_a_label_does_not_depend_on_the_order_of_calls(
        self, make_teacher: Callable[[], Teacher], waves
    ):
        first, second = make_teacher(), make_teacher()
        rollout, other = waves(name="a"), waves(name="b")
        first.begin(rollout, order=0, attempt=0)
        forward = [first.label(step) for step in range(rollout.steps)]
        second.begin(other, order=1, attempt=0)
        second.label(3)
        second.begin(rollout, order=0, attempt=0)
        backward = [second.label(step) for step in reversed(range(rollout.steps))]
        assert forward == backward[::-1]

    def test_it_has_a_pseudonym(self, make_teacher: Callable[[], Teacher]):
        assert make_teacher().name

    def test_label_before_begin_says_what_to_call(self, make_teacher: Callable[[], Teacher]):
        with pytest.raises(SteerlabError, match="begin"):
            make_teacher().label(0)

    @pytest.mark.parametrize("step", [-1, 160])
    def test_a_step_outside_the_rollout_is_an_error(
        self, make_teacher: Callable[[], Teacher], step: int, waves
    ):
        teacher = make_teacher()
        teacher.begin(waves(), order=0, attempt=0)
        with pytest.raises(SteerlabError, match=r"0\.\.159"):
            teacher.label(step)


def test_a_perfect_teacher_gives_the_oracle(waves):
    rollout = waves()
    np.testing.assert_array_equal(respond(TeacherStyle(), rollout), rollout.oracle_label)


@settings(deadline=None)
@given(gain=st.floats(0.1, 5.0))
def test_gain_scales_and_saturates(gain: float, waves):
    rollout = waves()
    expected = np.clip(gain * rollout.oracle_label, -WHEEL_LIMIT, WHEEL_LIMIT)
    np.testing.assert_allclose(respond(TeacherStyle(gain=gain), rollout), expected, atol=1e-12)


@settings(deadline=None)
@given(
    delay_steps=st.integers(-20, 20),
    control_hz=st.sampled_from([10.0, 20.0, 50.0]),
)
def test_delay_of_whole_steps_shifts(delay_steps: int, control_hz: float, waves):
    rollout = waves(control_hz=control_hz)
    label = respond(TeacherStyle(delay_s=delay_steps / control_hz), rollout)
    source = np.clip(np.arange(rollout.steps) - delay_steps, 0, rollout.steps - 1)
    np.testing.assert_allclose(label, rollout.oracle_label[source], atol=1e-9)


def test_a_fraction_of_a_step_lies_between(make_rollout):
    ramp = make_rollout(np.linspace(0.0, 2.0, 81))
    label = respond(TeacherStyle(delay_s=0.0625), ramp)
    np.testing.assert_allclose(label[2:], ramp.oracle_label[2:] - 1.25 * 0.025)


def test_a_preview_sees_the_actual_future(make_rollout):
    label = np.zeros(60)
    label[40:] = 1.0
    seen = respond(TeacherStyle(delay_s=-0.5), make_rollout(label))
    assert seen[29] == 0.0
    assert seen[30] == 1.0


def test_lag_follows_the_closed_form_on_a_ramp(make_rollout):
    t_s = np.arange(100) / 20.0
    label = respond(TeacherStyle(lag_s=0.2), make_rollout(0.4 * t_s))
    np.testing.assert_allclose(label, 0.4 * (t_s - 0.2 * (1.0 - np.exp(-t_s / 0.2))), atol=1e-12)


@settings(deadline=None)
@given(
    gain=st.floats(0.3, 2.0),
    delay_s=st.floats(-0.4, 0.6),
    lag_s=st.floats(0.0, 0.3),
    dead_zone=st.floats(0.0, 0.3),
)
def test_a_style_means_the_same_at_any_control_rate(
    gain: float, delay_s: float, lag_s: float, dead_zone: float, waves
):
    style = TeacherStyle(gain=gain, delay_s=delay_s, lag_s=lag_s, dead_zone=dead_zone)
    slow, fast = respond(style, waves(control_hz=20.0)), respond(style, waves(control_hz=100.0))
    # The last half second differs: the fast rollout holds its end value a few steps later.
    np.testing.assert_allclose(slow[:-12], fast[::5][:-12], atol=0.03)


@settings(deadline=None)
@given(seed=st.integers(0, 2**32), gain=st.floats(0.1, 20.0), noise=st.floats(0.0, 3.0))
def test_labels_never_pass_full_lock(seed: int, gain: float, noise: float, waves):
    style = TeacherStyle(gain=gain, constant_noise=noise, signal_noise=noise, noise_time_s=0.2)
    assert np.abs(respond(style, waves(), seed=seed)).max() <= WHEEL_LIMIT


def test_dead_zone_ignores_small_stimuli_without_a_jump(make_rollout):
    label = respond(TeacherStyle(dead_zone=0.3), make_rollout(np.array([0.2, -0.3, 0.5, -1.0])))
    np.testing.assert_allclose(label, [0.0, 0.0, 0.2, -0.7])


def test_who_is_satisfied_rests_and_hovering_about_the_tolerance_changes_nothing(make_rollout):
    truth = np.array([0.3, 0.55, 0.7, 0.5, 0.45, 0.3, 0.5, 0.55, -0.7, -0.5])
    label = respond(TeacherStyle(tolerance=0.5), make_rollout(truth))  # the robot's wheel is at 0
    corrects = np.array([0, 0, 1, 1, 1, 0, 0, 0, 1, 1])  # begins above .6, ends below .4
    np.testing.assert_array_equal(label, truth * corrects)


def test_what_counts_is_how_far_the_robot_is_off_and_not_how_far_the_way_turns(make_rollout):
    truth = np.full(40, 1.0)
    robot = np.r_[np.full(20, 1.2), np.full(20, 0.0)]
    rollout = replace(make_rollout(truth), robot_wheel=robot)
    style = TeacherStyle(tolerance=0.5, gain=0.8, bias=0.1, constant_noise=0.05)
    label = respond(style, rollout)
    assert (label[:20] == 0.0).all()  # neither bias nor noise moves a wheel that is let go
    assert label[20:].mean() == pytest.approx(0.9, abs=0.05)
    late = respond(replace(style, delay_s=0.25), rollout)
    assert (late[:24] == 0.0).all()
    assert (late[25:] != 0.0).all()
    slow = respond(TeacherStyle(tolerance=0.5, lag_s=0.2), rollout)
    assert 0.0 < slow[20] < slow[21] < slow[39] < 1.0


def test_without_tolerance_a_perfect_robot_is_corrected_too(waves):
    rollout = waves()
    perfect = replace(rollout, robot_wheel=rollout.oracle_label)
    np.testing.assert_array_equal(respond(NOISY, perfect), respond(NOISY, rollout))
    assert (respond(replace(NOISY, tolerance=0.1), perfect) == 0.0).all()


def test_drift_changes_gain_over_the_session(waves):
    style = TeacherStyle(gain=0.5, drift=0.1)
    rollout = waves()
    first, fourth = respond(style, rollout), respond(style, rollout, order=3)
    np.testing.assert_allclose(fourth, np.exp(0.3) * first)


def test_noise_has_the_stated_size_and_correlation(make_rollout):
    still = make_rollout(np.full(40_000, 0.5))
    style = TeacherStyle(constant_noise=0.05, signal_noise=0.1, noise_time_s=0.2)
    noise = respond(style, still) - 0.5
    assert noise.std() == pytest.approx(0.05 + 0.1 * 0.5, rel=0.05)
    assert np.corrcoef(noise[4:], noise[:-4])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_no_two_teachers_rollouts_or_attempts_share_noise(make_rollout):
    style = TeacherStyle(constant_noise=1.0)
    flat = [make_rollout(np.zeros(50), name=name) for name in ("a", "b")]
    rows = [
        ScriptedTeacher(name, style, seed).respond(rollout, order=0, attempt=attempt)
        for name in ("p", "q")
        for seed in (0, 1)
        for rollout in flat
        for attempt in (0, 1)
    ]
    assert len({row.tobytes() for row in rows}) == len(rows)
    assert np.abs(np.corrcoef(rows) - np.eye(len(rows))).max() < 0.6


def test_order_does_not_change_noise(waves):
    style = TeacherStyle(constant_noise=0.3)
    rollout = waves()
    np.testing.assert_array_equal(respond(style, rollout), respond(style, rollout, order=5))


def test_masked_steps_are_bridged_by_the_teacher_and_stay_masked_in_the_rollout(make_rollout):
    label = np.linspace(0.0, 2.0, 41)
    masked = label.copy()
    masked[10:20] = np.nan
    rollout = make_rollout(masked)
    np.testing.assert_allclose(respond(TeacherStyle(), rollout), label, atol=1e-12)
    assert np.isnan(rollout.oracle_label[10:20]).all()


def test_a_rollout_without_any_oracle_label_is_an_error(make_rollout):
    with pytest.raises(InvalidConfig, match="no valid oracle"):
        respond(TeacherStyle(), make_rollout(np.full(30, np.nan)))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("gain", 0.0),
        ("gain", float("nan")),
        ("lag_s", -0.1),
        ("dead_zone", -1.0),
        ("signal_noise", -0.1),
        ("delay_s", float("inf")),
        ("tolerance", -0.5),
    ],
)
def test_impossible_styles_are_refused(field: str, value: float):
    with pytest.raises(InvalidConfig, match=field):
        TeacherStyle(**{field: value})


def test_order_and_attempt_must_not_be_negative(waves):
    with pytest.raises(InvalidConfig, match="order -1"):
        ScriptedTeacher("t", TeacherStyle(), 0).begin(waves(), order=-1, attempt=0)


def test_not_ready_is_a_runtime_error():
    assert issubclass(TeacherNotReady, RuntimeError)


def test_step_by_step_equals_the_whole_response(waves):
    teacher, rollout = ScriptedTeacher("t", NOISY, 1), waves()
    teacher.begin(rollout, order=2, attempt=1)
    stepped = [teacher.label(step) for step in range(rollout.steps)]
    assert stepped == teacher.respond(rollout, order=2, attempt=1).tolist()
