import subprocess
import sys
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.errors import InvalidConfig, InvalidWorld, StateMismatch
from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import Block, WorldSpec

LONG = DrivingConfig(time_limit_s=600.0, start_jitter_m=0.0, start_jitter_rad=0.0)
EMPTY = WorldSpec(
    name="empty", ball_xy_m=(180.0, 180.0), start=Pose2D(0, 0, 0), half_extent_m=200.0
)


def test_hands_off_drives_exactly_straight(open_world):
    with Driving(open_world) as driving:
        driving.reset(start=Pose2D(0.0, 0.0, 0.0))
        for _ in range(80):
            driving.step(0.0)
        pose = driving.state.pose
        assert pose.x_m == pytest.approx(20.0, abs=1e-6)
        assert (pose.y_m, pose.heading_rad) == (0.0, 0.0)


@pytest.mark.parametrize("wheel", [0.5, 1.0, 1.5, 2.0])
def test_turning_radius_agrees_with_a_dynamic_bicycle(wheel):
    """With equal stiffness on both axles and the mass midway the car is neutral: R = L / tan(d)."""
    with Driving(EMPTY, config=LONG) as driving:
        driving.reset(start=Pose2D(0, 0, 0))
        for _ in range(200):
            driving.step(wheel)
        state = driving.state
        # v² / R towards the centre of the turn, as a rotating velocity has
        np.testing.assert_allclose(
            state.acceleration,
            state.velocity[2] * np.array([-state.velocity[1], state.velocity[0]]),
            atol=0.15,
        )
        radius_m = state.velocity[0] / state.velocity[2]
        kinematic_m = driving.car.wheelbase_m / np.tan(driving.car.road_wheel_rad(wheel))
        assert radius_m == pytest.approx(kinematic_m, rel=0.03)


def test_left_and_right_are_mirror_images(open_world):
    ends = []
    for sign in (1.0, -1.0):
        with Driving(open_world) as driving:
            driving.reset(start=Pose2D(0, 0, 0))
            for step in range(60):
                driving.step(sign * 2.0 * np.sin(step / 9.0))
            ends.append(driving.state.pose)
    assert ends[0].x_m == pytest.approx(ends[1].x_m, abs=1e-7)
    assert ends[0].y_m == pytest.approx(-ends[1].y_m, abs=1e-7)
    assert ends[0].heading_rad == pytest.approx(-ends[1].heading_rad, abs=1e-7)


def test_each_ending(open_world, wall_world):
    def drive(world, wheel=0.0, start=None, **config):
        with Driving(world, config=DrivingConfig(**config)) as driving:
            driving.reset(start=start or Pose2D(0, 0, 0))
            while driving.outcome is Outcome.RUNNING:
                driving.step(wheel)
            return driving.outcome, driving.state.t_s

    assert drive(open_world)[0] is Outcome.BALL_REACHED
    outcome, t_s = drive(wall_world)
    assert outcome is Outcome.BLOCK_HIT
    assert t_s == pytest.approx((14.0 - 2.1) / 5.0, abs=0.1)
    away = Pose2D(0.0, 0.0, pi)
    assert drive(open_world, start=away)[0] is Outcome.OUT_OF_BOUNDS
    assert drive(open_world, wheel=2.5, time_limit_s=4.0) == (Outcome.TIME_LIMIT, 4.0)


@pytest.mark.parametrize("angle_rad", [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 1.57])
def test_even_a_graze_that_lasts_one_physics_step_is_a_hit(angle_rad):
    """Straight at a long wall: the first overlap of the chassis ends the drive in that step."""
    wall = Block(0.0, 3.0, 45.0, 1.0)  # its side is at y = 2
    car = CarConfig()
    corner_m = car.length_m / 2 * np.sin(angle_rad) + car.width_m / 2 * np.cos(angle_rad)
    start = Pose2D(-30.0, 2.0 - corner_m - 0.6, angle_rad)
    world = WorldSpec(name="wall", ball_xy_m=(0.0, -45.0), start=start, blocks=(wall,))
    with Driving(world) as driving:
        driving.reset(start=start)
        while driving.outcome is Outcome.RUNNING:
            driving.step(0.0)
        assert driving.outcome is Outcome.BLOCK_HIT
        assert driving.state.t_s == pytest.approx(0.6 / (5.0 * np.sin(angle_rad)), abs=0.06)


def test_blocks_nearby_do_not_push():
    """Contacts are listed a metre early so that grazes are seen; they must act only on touch."""
    start = Pose2D(-20.0, 0.0, 0.0)
    beside = Block(0.0, 0.9 + 1.0 + 0.3, 30.0, 1.0)  # its side 30 cm from the car's
    ends = []
    for blocks in ((beside,), ()):
        world = WorldSpec(name="w", ball_xy_m=(0.0, -40.0), start=start, blocks=blocks)
        with Driving(world) as driving:
            data = driving.data
            data.qpos[:3] = -20.0, 0.0, 0.0
            data.qvel[:2] = 5.0, 0.0
            for _ in range(100):
                driving.step(0.0)
            assert driving.outcome is Outcome.RUNNING
            ends.append(driving.state.pose)
    assert ends[0] == ends[1]


def test_brake_stops_and_throttle_speeds_up():
    with Driving(EMPTY, config=LONG) as driving:
        driving.reset(start=Pose2D(0, 0, 0))
        for _ in range(60):
            driving.step(0.0, throttle=1.0)
        assert driving.state.velocity[0] == pytest.approx(10.0, rel=0.05)
        for _ in range(40):
            driving.step(0.0, throttle=1.0, brake=1.0)
        assert abs(driving.state.velocity[0]) < 0.01


def test_acceleration_is_the_change_of_velocity():
    with Driving(EMPTY, config=DrivingConfig(control_hz=100.0, time_limit_s=600.0)) as driving:
        driving.reset(start=Pose2D(0, 0, 0.7))
        for step in range(300):
            before = driving.data.qvel[:2].copy()
            driving.step(1.5 * np.sin(step / 30.0), throttle=0.8)
            change = (driving.data.qvel[:2] - before) / 0.01
        heading = driving.state.pose.heading_rad
        into_body = np.array(
            [[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]]
        )
        np.testing.assert_allclose(driving.state.acceleration, into_body @ change, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), cut=st.integers(0, 60))
def test_restore_is_bit_exact(seed, cut, blocky_world):
    wheels = np.random.default_rng(seed).uniform(-WHEEL_LIMIT, WHEEL_LIMIT, 80)
    with Driving(blocky_world) as driving:
        driving.reset(seed)
        for wheel in wheels[:cut]:
            driving.step(wheel)
        saved, state = driving.physics_state(), driving.state
        straight = []
        for wheel in wheels[cut:]:
            driving.step(wheel)
            straight.append(driving.physics_state())
        ends = driving.outcome
        restored = driving.restore(saved)
        assert restored.pose == state.pose
        assert restored.step == state.step
        np.testing.assert_array_equal(restored.velocity, state.velocity)
        np.testing.assert_array_equal(restored.acceleration, state.acceleration)
        again = []
        for wheel in wheels[cut:]:
            driving.step(wheel)
            again.append(driving.physics_state())
        np.testing.assert_array_equal(straight, again)
        assert driving.outcome is ends


_HASH = """
import hashlib, numpy as np
from steerlab.sim.engine.driving import Driving
from steerlab.sim.world_generator import generate_world
with Driving(generate_world("h", np.random.default_rng(5))) as driving:
    driving.reset(7)
    for wheel in np.random.default_rng(1).uniform(-2.5, 2.5, 200):
        driving.step(wheel)
    print(hashlib.sha256(driving.physics_state().tobytes()).hexdigest())
"""


def test_fresh_processes_agree():
    runs = [
        subprocess.run([sys.executable, "-c", _HASH], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert runs[0].stdout == runs[1].stdout != ""


def test_starts_follow_the_seed(blocky_world):
    with Driving(blocky_world) as driving:
        first, again, other = (driving.reset(seed).pose for seed in (4, 4, 5))
    assert first == again != other


def test_a_start_inside_a_block_is_refused(wall_world):
    with Driving(wall_world) as driving, pytest.raises(InvalidWorld, match="stands in Block"):
        driving.reset(start=Pose2D(14.0, 0.0, 0.0))


def test_a_state_of_another_world_is_refused(open_world, wall_world):
    with Driving(open_world) as one, Driving(wall_world) as other:
        with pytest.raises(StateMismatch, match="'wall'"):
            other.restore(one.physics_state())
        broken = one.physics_state()
        broken[3] = np.nan
        with pytest.raises(StateMismatch, match="NaN"):
            one.restore(broken)


def test_a_missing_input_never_becomes_a_wheel_position(open_world):
    with Driving(open_world) as driving:
        for bad in ({"wheel": np.nan}, {"wheel": 0.0, "throttle": np.nan}):
            with pytest.raises(InvalidConfig, match="not a number"):
                driving.step(**bad)


@pytest.mark.parametrize("control_hz", [0.0, -20.0, 30.0, 200.0])
def test_a_rate_that_physics_cannot_keep_is_refused(control_hz):
    with pytest.raises(InvalidConfig, match="control_hz"):
        DrivingConfig(control_hz=control_hz)
