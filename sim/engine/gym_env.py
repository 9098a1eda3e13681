"""The task for Gymnasium: ``gymnasium.make("steerlab/DriveToBall-v0")`` after importing this."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import WorldSpec
from steerlab.sim.world_generator import generate_world

ENV_ID = "steerlab/DriveToBall-v0"
Observation = dict[str, NDArray[Any]]


class DriveToBallEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Observation: ``state`` (8,) pose, velocity, acceleration; ``image`` if a camera is given.

    Action: (1,) wheel in [-2.5, 2.5]. Reward 1 on reaching the ball. The time limit is inside
    (``truncated``): Gymnasium's wrapper would cost a tenth of the speed. ``info`` has ``outcome``.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - gymnasium's own

    def __init__(
        self,
        world: WorldSpec | None = None,
        *,
        car: CarConfig | None = None,
        config: DrivingConfig | None = None,
        camera: CameraConfig | None = None,
        render_mode: str | None = None,
    ) -> None:
        if world is None:
            world = generate_world("default", np.random.default_rng(0))
        self.driving = Driving(world, car=car, config=config)
        self.render_mode = render_mode
        self.action_space = spaces.Box(-WHEEL_LIMIT, WHEEL_LIMIT, (1,), np.float32)
        observed: dict[str, Any] = {"state": spaces.Box(-np.inf, np.inf, (8,), np.float64)}
        self._camera: Camera | None = None
        self._render_camera: Camera | None = None
        if camera is not None:
            self._camera = Camera(self.driving.model, self.driving.data, camera)
            shape = (camera.height, camera.width, 3)
            observed["image"] = spaces.Box(0, 255, shape, np.uint8)
        observation_space: Any = spaces.Dict(observed)
        self.observation_space = observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start at a pose drawn around the world's start; ``options`` are not used."""
        super().reset(seed=seed, options=options)
        self.driving.reset(int(self.np_random.integers(2**31)))
        return self._observe(), {"outcome": str(self.driving.outcome)}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the wheel for one control step."""
        outcome = self.driving.step(float(action[0]))
        reached = outcome is Outcome.BALL_REACHED
        ended = outcome not in (Outcome.RUNNING, Outcome.TIME_LIMIT)
        late = outcome is Outcome.TIME_LIMIT
        return self._observe(), float(reached), ended, late, {"outcome": str(outcome)}

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A 640 x 360 picture from behind the car, if made with ``render_mode="rgb_array"``."""
        if self.render_mode != "rgb_array":
            return None
        if self._render_camera is None:
            config = CameraConfig(width=640, height=360, view="chase")
            self._render_camera = Camera(self.driving.model, self.driving.data, config)
        return self._render_camera.frame().copy()

    def close(self) -> None:
        """Free the cameras; calling it again does nothing."""
        for camera in (self._camera, self._render_camera):
            if camera is not None:
                camera.close()

    def _observe(self) -> Observation:
        state = self.driving.state
        pose = (state.pose.x_m, state.pose.y_m, state.pose.heading_rad)
        observation: Observation = {
            "state": np.concatenate((pose, state.velocity, state.acceleration))
        }
        if self._camera is not None:
            observation["image"] = self._camera.frame().copy()
        return observation


gymnasium.register(id=ENV_ID, entry_point=f"{__name__}:{DriveToBallEnv.__name__}")
