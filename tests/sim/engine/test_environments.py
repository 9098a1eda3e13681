import warnings

import gymnasium
import numpy as np
import pytest
from absl.testing import absltest
from dm_env import test_utils
from gymnasium.utils.env_checker import check_env

from steerlab.sim.engine import gym_env
from steerlab.sim.engine.camera import CameraConfig
from steerlab.sim.engine.drive_to_ball import environment
from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.rollout import Outcome
from steerlab.sim.world_generator import generate_world

EXACT_START = DrivingConfig(start_jitter_m=0.0, start_jitter_rad=0.0)


class TestDmEnv(test_utils.EnvironmentTestMixin, absltest.TestCase):
    """dm_env's own conformance suite."""

    def make_object_under_test(self):
        return environment(generate_world("blocky", np.random.default_rng(3)), seed=0)


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


def test_dm_env_time_limit_keeps_the_discount(open_world):
    config = DrivingConfig(time_limit_s=1.0, start_jitter_m=0.0, start_jitter_rad=0.0)
    env = environment(open_world, seed=0, config=config, pedals=True)
    step, count = env.reset(), 0
    while not step.last():
        step = env.step([0.0, 0.5, 0.0])
        count += 1
    assert (count, step.discount, env.task.outcome) == (20, 1.0, Outcome.TIME_LIMIT)
    env.close()


@pytest.mark.render
def test_gymnasium_checker():
    env = gymnasium.make(gym_env.ENV_ID, camera=CameraConfig(), render_mode="rgb_array").unwrapped
    with warnings.catch_warnings():  # the checker advises on ranges; ours are physical units
        warnings.filterwarnings("ignore", message=".*WARN.*", category=UserWarning)
        check_env(env)
    assert env.render().shape == (360, 640, 3)
    env.close()


def test_gymnasium_truncates_at_the_time_limit(open_world):
    env = gym_env.DriveToBallEnv(open_world, config=DrivingConfig(time_limit_s=0.5))
    env.reset(seed=1)
    steps = [env.step(np.zeros(1, np.float32)) for _ in range(10)]
    assert [step[3] for step in steps] == [False] * 9 + [True]
    assert steps[-1][4]["outcome"] == "time_limit"
    env.close()
