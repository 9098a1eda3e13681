"""Teachers outside the scripted family keep the contract and are unusual in the way they say."""

import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherNotReady, TeacherStyle
from steerlab.sim.teachers import Teacher
from steerlab.sim.unusual_teachers import (
    QUIRKS,
    AsymmetricGain,
    Lapses,
    PowerGain,
    Quirk,
    SampleAndHold,
    UnderdampedHand,
    UnusualTeacher,
    sample_unusual,
)
from steerlab.sim.vehicle import WHEEL_LIMIT

STEP_S = 0.05
PERFECT = TeacherStyle()


def respond(quirk: Quirk, to: Rollout, *, seed: int = 1, attempt: int = 0) -> np.ndarray:
    teacher = UnusualTeacher(ScriptedTeacher("u", PERFECT, seed), quirk)
    return teacher.respond(to, order=0, attempt=attempt)


@pytest.mark.parametrize("kind", QUIRKS)
class TestContract:
    def test_labels_are_finite_within_the_wheel_and_repeatable(self, kind, waves):
        teacher: Teacher = sample_unusual(kind, "human", 2, 100, prefix="u")[1]
        one = waves(10.0)
        labels = []
        for _ in range(2):
            teacher.begin(one, order=0, attempt=0)
            labels.append([teacher.label(step) for step in range(one.steps)])
        assert labels[0] == labels[1]
        assert np.isfinite(labels[0]).all()
        assert np.abs(labels[0]).max() <= WHEEL_LIMIT

    def test_it_differs_from_the_scripted_teacher_it_is_made_from(self, kind, waves):
        one = waves(30.0)
        for teacher in sample_unusual(kind, "low", 3, 100, prefix="u"):
            usual = teacher.scripted.respond(one, order=0, attempt=0)
            assert np.abs(teacher.respond(one, order=0, attempt=0) - usual).mean() > 0.002

    def test_the_first_teachers_do_not_change_with_the_count(self, kind):
        few, many = (sample_unusual(kind, "low", count, 7, prefix="u") for count in (1, 3))
        assert few[0].quirk == many[0].quirk
        assert few[0].scripted.style == many[0].scripted.style
        assert few[0].name == "u-000"

    def test_a_masked_step_is_bridged_by_the_teacher(self, kind, waves, make_rollout):
        label = waves(10.0).oracle_label.copy()
        label[50:55] = np.nan
        teacher = sample_unusual(kind, "low", 1, 7, prefix="u")[0]
        assert np.isfinite(teacher.respond(make_rollout(label), order=0, attempt=0)).all()

    def test_asked_too_early_or_too_far_it_says_so(self, kind, waves, make_rollout):
        teacher = sample_unusual(kind, "low", 1, 7, prefix="u")[0]
        with pytest.raises(TeacherNotReady, match="begin"):
            teacher.label(0)
        teacher.begin(waves(10.0), order=0, attempt=0)
        with pytest.raises(TeacherNotReady, match="outside"):
            teacher.label(10_000)
        with pytest.raises(InvalidConfig, match="no valid oracle label"):
            teacher.respond(make_rollout(np.full(5, np.nan)), order=0, attempt=0)
        with pytest.raises(InvalidConfig, match="attempt"):
            teacher.respond(waves(10.0), order=0, attempt=-1)


def test_asymmetric_gain_is_larger_on_one_side(make_rollout):
    labels = respond(
        AsymmetricGain(log_ratio=np.log(4.0)), make_rollout(np.array([-1.0, 0.0, 1.0]))
    )
    np.testing.assert_allclose(labels, [-0.5, 0.0, 2.0])


def test_power_gain_keeps_one_and_the_sign(make_rollout):
    labels = respond(PowerGain(exponent=2.0), make_rollout(np.array([-1.0, 0.5, 1.2])))
    np.testing.assert_allclose(labels, [-1.0, 0.25, 1.44])


def test_an_underdamped_hand_overshoots_as_theory_says_and_settles(make_rollout):
    step = np.r_[np.zeros(10), np.ones(190)]
    hand = respond(UnderdampedHand(natural_hz=0.5, damping=0.3), make_rollout(step))
    overshoot = np.exp(-np.pi * 0.3 / np.sqrt(1.0 - 0.09))  # Ogata, Modern Control Engineering
    assert hand.max() == pytest.approx(1.0 + overshoot, abs=0.005)
    assert hand[-1] == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(hand[:10], 0.0)
    np.testing.assert_allclose(
        respond(UnderdampedHand(natural_hz=1.0, damping=0.5), make_rollout(np.ones(9))), 1.0
    )


def test_sample_and_hold_changes_once_a_period_and_only_to_values_seen(waves):
    one = waves(10.0)
    held = respond(SampleAndHold(period_s=0.5), one)
    changes = np.flatnonzero(np.diff(held))
    assert set(np.diff(changes).tolist()) == {10}
    assert np.isin(held, one.oracle_label).all()


def test_lapses_leave_the_wheel_where_it_is_and_come_as_often_as_they_say(make_rollout):
    ramp = make_rollout(np.linspace(-2.0, 2.0, 24_000))  # twenty minutes
    held = respond(Lapses(per_minute=6.0, length_s=1.0), ramp)
    still = np.diff(held) == 0.0
    assert 0.05 < still.mean() < 0.15  # 6 a minute of a second each: 10 %
    assert np.isin(held, ramp.oracle_label).all()
    np.testing.assert_array_equal(
        respond(Lapses(per_minute=0.0, length_s=1.0), ramp), ramp.oracle_label
    )


def test_another_attempt_lapses_at_other_times(make_rollout):
    quirk, ramp = Lapses(per_minute=12.0, length_s=1.0), make_rollout(np.linspace(-2.0, 2.0, 2000))
    first, second = (respond(quirk, ramp, attempt=attempt) for attempt in (0, 1))
    assert (first != second).any()


@pytest.mark.parametrize(
    "make",
    [
        lambda: PowerGain(exponent=0.0),
        lambda: UnderdampedHand(natural_hz=1.0, damping=1.0),
        lambda: SampleAndHold(period_s=0.0),
        lambda: Lapses(per_minute=-1.0, length_s=1.0),
        lambda: sample_unusual("sleepy", "low", 1, 0, prefix="u"),  # type: ignore[arg-type]
    ],
)
def test_nonsense_is_refused(make):
    with pytest.raises(InvalidConfig):
        make()
