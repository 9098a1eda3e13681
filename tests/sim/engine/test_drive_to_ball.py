"""The dm_control interface, where dm_control installs, and what is said where it does not."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.engine.scene import compose
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world_generator import generate_world

needs_dm_control = pytest.mark.skipif(
    sys.version_info >= (3, 13), reason="dm_control installs on Python 3.11 and 3.12 only"
)
if sys.version_info < (3, 13):
    from absl.testing import absltest
    from dm_control import mjcf
    from dm_env import test_utils

    from steerlab.sim.engine.drive_to_ball import DriveToBall, environment

    class TestDmEnv(test_utils.EnvironmentTestMixin, absltest.TestCase):
        """dm_env's own conformance suite."""

        def make_object_under_test(self):
            return environment(generate_world("blocky", np.random.default_rng(3)), seed=0)


EXACT_START = DrivingConfig(start_jitter_m=0.0, start_jitter_rad=0.0)
WORLDS = {rollout.world.name: rollout.world for rollout in load_calibration_set()}


def _bytes_of(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@needs_dm_control
@pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS)
def test_composer_and_mjspec_compile_the_same_model(world):
    """The shipped rollouts were recorded in models that dm_control composed: no bit has changed."""
    physics = mjcf.Physics.from_mjcf_model(DriveToBall(world).root_entity.mjcf_model)
    ours = compose(world, CarConfig()).compile()
    assert _bytes_of(physics.model.ptr) == _bytes_of(ours)
    physics.free()


def test_without_dm_control_one_sentence_says_what_to_do():
    hidden = "import sys; sys.modules['dm_control'] = None\n"
    done = subprocess.run(
        [sys.executable, "-c", hidden + "import steerlab.sim.engine.drive_to_ball"],
        capture_output=True,
        text=True,
    )
    assert "MissingPackage: The dm_env and composer interface needs dm_control" in done.stderr
    assert "DriveToBallEnv, which need nothing more." in done.stderr


@needs_dm_control
def test_dm_env_and_driving_agree_bit_for_bit(blocky_world):
    env = environment(blocky_world, seed=0, config=EXACT_START)
    env.reset()
    with Driving(blocky_world) as driving:
        driving.reset()
        for step in range(80):
            wheel = 2.0 * np.sin(step / 7.0)
            observation = env.step([wheel]).observation
            driving.step(wheel)
            pose = driving.state.pose
            expected = (pose.x_m, pose.y_m, pose.heading_rad)
            assert tuple(observation["car/pose"]) == expected
            np.testing.assert_array_equal(observation["car/velocity"], driving.state.velocity)
    env.close()


@needs_dm_control
def test_dm_env_ends_with_reward_and_discount(open_world, wall_world):
    for world, outcome, reward, discount in (
        (open_world, Outcome.BALL_REACHED, 1.0, 0.0),
        (wall_world, Outcome.BLOCK_HIT, 0.0, 0.0),
    ):
        env = environment(world, seed=0, config=EXACT_START)
        step = env.reset()
        while not step.last():
            step = env.step([0.0])
        assert env.task.outcome is outcome
        assert (step.reward, step.discount) == (reward, discount)
        env.close()


@needs_dm_control
def test_dm_env_time_limit_keeps_the_discount(open_world):
    config = DrivingConfig(time_limit_s=1.0, start_jitter_m=0.0, start_jitter_rad=0.0)
    env = environment(open_world, seed=0, config=config, pedals=True)
    step, count = env.reset(), 0
    while not step.last():
        step = env.step([0.0, 0.5, 0.0])
        count += 1
    assert (count, step.discount, env.task.outcome) == (20, 1.0, Outcome.TIME_LIMIT)
    env.close()
