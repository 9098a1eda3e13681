import numpy as np
import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.engine.driving import Driving
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
from steerlab.teleop.devices.contract import Button, DeviceError, DeviceSample
from steerlab.teleop.drives.live import LiveDrive
from steerlab.teleop.drives.replay import Replay, interpolate
from steerlab.teleop.drives.who_drives import (
    PersonDrives,
    RobotDrives,
    Takeover,
    TakeoverConfig,
)

ROLLOUT = load_calibration_set()[0]


def sample(wheel, *held, **more):
    return DeviceSample(wheel=wheel, buttons=frozenset(held), **more)


def test_a_replay_is_the_recording_whatever_the_participant_does():
    steps = {}
    for wheel in (-2.5, 0.0, 2.5):
        replay = Replay(ROLLOUT)
        replay.begin(participant="p", attempt=0)
        steps[wheel] = [replay.step(n, sample(wheel)) for n in range(ROLLOUT.steps)]
        assert replay.over
        assert replay.outcome is ROLLOUT.outcome
    for left, right in zip(steps[-2.5], steps[2.5], strict=True):
        assert (left.x_m, left.y_m, left.heading_rad) == (right.x_m, right.y_m, right.heading_rad)
        assert left.executed_wheel == right.executed_wheel == left.robot_wheel
        assert (left.teacher_label, right.teacher_label) == (-2.5, 2.5)
        assert left.gate is Driver.ROBOT
    np.testing.assert_array_equal([one.robot_wheel for one in steps[0.0]], ROLLOUT.robot_wheel)


def test_a_replay_shows_the_stored_states_exactly_and_lines_in_between():
    replay = Replay(ROLLOUT)
    replay.begin(participant="p", attempt=0)
    assert replay.between(0.0).pose == ROLLOUT.pose_at(0)
    for n in range(30):
        replay.step(n, sample(0.0))
        assert replay.between(0.0).pose == ROLLOUT.pose_at(n)
    halfway = replay.between(0.5).pose
    here, there = ROLLOUT.pose_at(29), ROLLOUT.pose_at(30)
    assert halfway.x_m == pytest.approx((here.x_m + there.x_m) / 2)
    replay.begin(participant="p", attempt=1)
    assert not replay.over
    assert replay.between(0.0).pose == ROLLOUT.pose_at(0)


def test_interpolation_turns_the_short_way_round():
    turned = interpolate(Pose2D(0, 0, 3.1), Pose2D(1, 0, -3.1), 0.5)
    assert turned.heading_rad == pytest.approx(np.pi)


def test_a_lost_device_gives_an_invalid_step_and_no_label():
    replay = Replay(ROLLOUT)
    replay.begin(participant="p", attempt=0)
    step = replay.step(0, DeviceSample(wheel=1.0, ok=False))
    assert step.teacher_label is None
    assert not step.label_valid


def drive_live(who, samples, policy=lambda state: 0.5, oracle=None):
    with Driving(ROLLOUT.world) as driving:
        live = LiveDrive("live-1", driving, policy, who, oracle=oracle)
        live.begin(participant="p", attempt=3)
        return [live.step(n, one) for n, one in enumerate(samples)], live.between(0.0)


def test_live_correction_labels_the_robots_drive_without_touching_it():
    quiet, _ = drive_live(RobotDrives(), [sample(0.0)] * 40)
    loud, _ = drive_live(RobotDrives(), [sample(2.5)] * 40, oracle=lambda state: state.t_s)
    assert [(s.x_m, s.y_m) for s in quiet] == [(s.x_m, s.y_m) for s in loud]
    assert {s.executed_wheel for s in loud} == {0.5}
    assert {s.teacher_label for s in loud} == {2.5}
    assert quiet[7].oracle_label is None
    assert loud[7].oracle_label == pytest.approx(0.35)
    assert (loud[7].rollout, loud[7].attempt) == ("live-1", 3)


def test_a_person_drives_with_wheel_and_pedals():
    still = [sample(0.0, throttle=0.0, brake=1.0)] * 60
    fast = [sample(0.0, throttle=1.0, brake=0.0)] * 60
    stopped, _ = drive_live(PersonDrives(pedals=True), still)
    driven, _ = drive_live(PersonDrives(pedals=True), fast)
    assert stopped[-1].speed_mps < 0.2
    assert driven[-1].speed_mps > 7.0
    assert {s.gate for s in driven} == {Driver.TEACHER}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (DeviceSample(wheel=None, ok=False), "says nothing"),
        (DeviceSample(wheel=0.0), "pedals"),
    ],
)
def test_a_person_who_drives_with_a_silent_device_is_an_error_and_never_zero(given, says):
    with pytest.raises(DeviceError, match=says):
        drive_live(PersonDrives(pedals=True), [given])


def test_taking_over_and_giving_back_never_jerks_the_wheel():
    config = TakeoverConfig(blend_steps=10)
    robot, person = 1.5, -2.0
    held = [False] * 20 + [True] * 30 + [False] * 30
    samples = [sample(person, *([Button.TAKE_OVER] if on else [])) for on in held]
    steps, _ = drive_live(Takeover(config), samples, policy=lambda state: robot)
    wheel = np.array([step.executed_wheel for step in steps])
    biggest = abs(robot - person) / config.blend_steps
    assert np.abs(np.diff(wheel)).max() == pytest.approx(biggest, rel=1e-6)
    assert (wheel[:20] == robot).all()
    assert wheel[49] == person
    assert wheel[-1] == robot
    assert [step.gate is Driver.TEACHER for step in steps] == held
    assert {step.teacher_label for step in steps} == {person}


def test_an_immediate_takeover_and_an_unplugged_wheel():
    gate = Takeover()
    gate.begin()
    assert gate.command(1.0, sample(-1.0, Button.TAKE_OVER)).wheel == -1.0  # nothing to go on from
    lost = DeviceSample(wheel=None, buttons=frozenset({Button.TAKE_OVER}), ok=False)
    assert gate.command(1.0, lost).gate is Driver.ROBOT


def test_a_live_drive_ends_with_the_worlds_outcome():
    steps = []
    with Driving(ROLLOUT.world) as driving:
        live = LiveDrive("live", driving, lambda state: 2.5, RobotDrives())
        live.begin(participant="p", attempt=0)
        while not live.over:
            steps.append(live.step(len(steps), sample(0.0)))
        assert live.outcome is not Outcome.RUNNING
        live.begin(participant="p", attempt=1)
        assert not live.over
