from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.live_teacher import DriveContext, LiveTeacher, softened
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherNotReady, TeacherStyle
from steerlab.sim.unusual_teachers import (
    OUT_OF_FAMILY,
    BangBang,
    Fatigue,
    LateBraking,
    UnusualTeacher,
    sample_out_of_family,
)

STEPS = 60
RNG = np.random.default_rng(0)


def _sitting() -> DriveContext:
    return DriveContext(name="drive", order=0, attempt=0, steps=STEPS, control_hz=20.0)


def _live(teacher, oracle, style="raw") -> np.ndarray:
    live = LiveTeacher(teacher, style)
    live.begin(_sitting())
    return np.array([live.react(value) for value in oracle])


@pytest.mark.parametrize(
    "style",
    [
        TeacherStyle(gain=1.7, bias=0.2, dead_zone=0.1),
        TeacherStyle(delay_s=0.23, lag_s=0.15),
        TeacherStyle(constant_noise=0.2, signal_noise=0.3, noise_time_s=0.2),
    ],
)
def test_whoever_only_looks_back_drives_as_they_would_label(style, make_rollout):
    oracle = np.sin(np.arange(STEPS) / 8.0)
    teacher = ScriptedTeacher("one", style, seed=3)
    whole = teacher.respond(make_rollout(oracle, name="drive"), order=0, attempt=0)
    assert _live(teacher, oracle) == pytest.approx(whole)


def test_who_is_sparse_corrects_a_robot_they_watch_as_they_would_label(make_rollout):
    oracle = np.sin(np.arange(STEPS) / 8.0)
    robot = np.where(np.arange(STEPS) < 30, oracle + 0.2, -0.3)
    style = TeacherStyle(gain=1.2, delay_s=0.13, lag_s=0.1, constant_noise=0.1, tolerance=0.5)
    teacher = ScriptedTeacher("one", style, seed=3)
    rollout = replace(make_rollout(oracle, name="drive"), robot_wheel=robot)
    whole = teacher.respond(rollout, order=0, attempt=0)
    live = LiveTeacher(teacher, "raw")
    live.begin(_sitting())
    labels = [live.react(*both) for both in zip(oracle, robot, strict=True)]
    assert labels == pytest.approx(whole)
    assert 20 < np.count_nonzero(whole == 0.0) < 50


@pytest.mark.parametrize("driving", ["softened", "raw"])
def test_who_drives_steers_all_the_time_however_sparsely_they_correct(driving):
    oracle = 0.4 * np.sin(np.arange(STEPS) / 8.0)
    style = TeacherStyle(delay_s=0.13, constant_noise=0.1)
    always = _live(ScriptedTeacher("one", style, 0), oracle, driving)
    sparse = _live(ScriptedTeacher("one", replace(style, tolerance=0.5), 0), oracle, driving)
    assert sparse.tolist() == always.tolist()


def test_nobody_sees_the_future_at_the_wheel():
    oracle = np.r_[np.zeros(30), np.ones(30)]
    early = ScriptedTeacher("one", TeacherStyle(delay_s=-0.5), seed=0)
    assert _live(early, oracle) == pytest.approx(oracle)


def test_a_missing_way_is_bridged():
    oracle = [0.5, np.nan, np.nan, 1.0]
    assert _live(ScriptedTeacher("one", TeacherStyle(), 0), oracle) == pytest.approx(
        [0.5, 0.5, 0.5, 1.0]
    )


def test_driving_is_softer_than_correcting():
    style = TeacherStyle(gain=3.0, delay_s=0.5, dead_zone=0.2, constant_noise=0.1)
    soft = softened(ScriptedTeacher("one", style, seed=7))
    assert soft.style.gain == pytest.approx(3.0**0.3)
    assert soft.style.delay_s == pytest.approx(0.15)
    assert soft.style.dead_zone == pytest.approx(0.06)
    assert soft.style.constant_noise == 0.1


def test_reacting_out_of_turn_is_refused():
    live = LiveTeacher(ScriptedTeacher("one", TeacherStyle(), 0))
    with pytest.raises(TeacherNotReady, match="begin"):
        live.react(0.0)
    live.begin(_sitting())
    for _ in range(STEPS):
        live.react(0.0)
    with pytest.raises(TeacherNotReady):
        live.react(0.0)


@pytest.mark.parametrize("family", OUT_OF_FAMILY)
def test_out_of_family_teachers_repeat_and_change_labels(family, make_rollout):
    rollout = make_rollout(np.sin(np.arange(STEPS) / 6.0))
    one, same = (sample_out_of_family(family, "low", 2, 5, prefix="x") for _ in range(2))
    for left, right in zip(one, same, strict=True):
        assert isinstance(left, UnusualTeacher)
        labels = left.respond(rollout, order=0, attempt=0)
        assert (labels == right.respond(rollout, order=0, attempt=0)).all()
        plain = left.scripted.respond(rollout, order=0, attempt=0)
        assert np.abs(labels - plain).mean() > 0.01


def test_an_unknown_family_lists_the_valid_ones():
    with pytest.raises(InvalidConfig, match="bang-bang"):
        sample_out_of_family("odd", "low", 1, 0, prefix="x")  # pyright: ignore[reportArgumentType]


def test_quirks_do_what_they_say():
    stimulus = np.array([0.0, 0.1, 0.5, -0.6])
    assert BangBang(level=1.0, threshold=0.2)(stimulus, 0.05, RNG).tolist() == [0, 0, 1, -1]
    pulse = np.r_[np.zeros(5), np.ones(10), np.zeros(20)]
    late = LateBraking(release_s=0.5)(pulse, 0.05, RNG)
    assert (late[:15] == pulse[:15]).all()
    assert late[15] == pytest.approx(np.exp(-0.1))
    assert (np.diff(late[15:]) < 0.0).all()
    tired = Fatigue(half_life_s=1.0)(np.ones(41), 0.05, RNG)
    assert tired[[0, 20, 40]] == pytest.approx([1.0, 0.5, 0.25])
