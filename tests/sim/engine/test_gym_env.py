import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from steerlab.sim.engine import gym_env
from steerlab.sim.engine.camera import CameraConfig
from steerlab.sim.engine.driving import DrivingConfig


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
