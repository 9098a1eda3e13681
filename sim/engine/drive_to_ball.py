"""``DriveToBall``: the paper's task as a dm_control composer task and a ``dm_env`` environment.

The entities are made of the same MJCF as ``scene.compose``, and compile to the same model.

Raises:
    MissingPackage: on import, where dm_control is not installed.
"""

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.car import CarControls, acceleration, pose, velocity
from steerlab.sim.engine.driving import DrivingConfig, Referee, draw_start
from steerlab.sim.engine.scene import PHYSICS_TIMESTEP_S, ground_mjcf, scene_parts
from steerlab.sim.errors import MissingPackage
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import WorldSpec

try:
    import dm_control.composer as composer
    import dm_control.mjcf as mjcf
    import dm_env
    from dm_control.composer.observation import observable
    from dm_env import specs
except ImportError as error:
    raise MissingPackage(
        f"The dm_env and composer interface needs dm_control ({error}): pip install "
        "'steerlab[dm-control]', which Python 3.11 and 3.12 can; on a newer one drive with "
        "steerlab.sim.engine.driving.Driving or gym_env.DriveToBallEnv, which need nothing more."
    ) from error


class Ground(composer.Arena):
    """The arena that the other entities are attached to."""

    def _build(self, half_extent_m: float) -> None:
        self._mjcf_root = mjcf.from_xml_string(ground_mjcf(half_extent_m))


class Part(composer.Entity):
    """What stands on the ground, from its MJCF: a block or the ball."""

    def _build(self, name: str, mjcf_text: str) -> None:
        self._mjcf_root = mjcf.from_xml_string(mjcf_text)
        self._mjcf_root.model = name

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The part's own MJCF."""
        return self._mjcf_root


class Car(Part):
    """The car, with the paper's state as observables."""

    def _build_observables(self) -> "CarObservables":
        return CarObservables(self)


class CarObservables(composer.Observables):
    """The paper's state without the image: position, heading, body velocity and acceleration."""

    @composer.observable
    def pose(self) -> observable.Generic:
        """(3,) x_m, y_m, heading_rad."""
        return observable.Generic(lambda physics: pose(physics.data.ptr))

    @composer.observable
    def velocity(self) -> observable.Generic:
        """(3,) forward and leftward speed in m/s, yaw rate in rad/s."""
        return observable.Generic(lambda physics: velocity(physics.data.ptr))

    @composer.observable
    def acceleration(self) -> observable.Generic:
        """(2,) forward and leftward acceleration in m/s²."""
        return observable.Generic(lambda physics: acceleration(physics.data.ptr))


class DriveToBall(composer.Task):
    """Steer to the ball; the episode ends on reaching it, a block hit, leaving the ground, or time.

    Reward is 1 in the step that reaches the ball, else 0; the discount is 0 at every end but the
    time limit, where it stays 1 (the task would have gone on).

    Args:
        world: where to drive.
        camera: adds the observable ``image``; None leaves it out and needs no OpenGL.
        pedals: the action is (wheel, throttle, brake) instead of (wheel,) at cruise speed.
    """

    def __init__(
        self,
        world: WorldSpec,
        *,
        car: CarConfig | None = None,
        config: DrivingConfig | None = None,
        camera: CameraConfig | None = None,
        pedals: bool = False,
    ) -> None:
        self.world = world
        self.config = config or DrivingConfig()
        self.outcome = Outcome.RUNNING
        self._car_config = car or CarConfig()
        self._pedals = pedals
        self._ground = Ground(world.half_extent_m)
        for name, text in scene_parts(world, self._car_config):
            part = Car(name, text) if name == "car" else Part(name, text)
            part.observables.enable_all()
            self._ground.attach(part)
        self._camera_config = camera
        self._camera: Camera | None = None
        self._steps = 0
        self._task_observables: OrderedDict[str, observable.Observable] = OrderedDict()
        if camera is not None:
            image = observable.Generic(self._image)
            image.enabled = True
            self._task_observables["image"] = image
        self.set_timesteps(1.0 / self.config.control_hz, PHYSICS_TIMESTEP_S)

    @property
    def root_entity(self) -> composer.Entity:
        """The arena that everything is attached to."""
        return self._ground

    @property
    def task_observables(self) -> OrderedDict[str, observable.Observable]:
        """``image`` (height, width, 3) uint8, if a camera was asked for."""
        return self._task_observables.copy()

    def action_spec(self, physics: mjcf.Physics) -> specs.BoundedArray:
        """(1,) wheel, or (3,) wheel, throttle, brake."""
        del physics
        low, high = [-WHEEL_LIMIT], [WHEEL_LIMIT]
        name = "wheel"
        if self._pedals:
            low, high, name = [*low, 0.0, 0.0], [*high, 1.0, 1.0], "wheel\tthrottle\tbrake"
        return specs.BoundedArray((len(low),), np.float64, low, high, name=name)

    def initialize_episode(
        self, physics: mjcf.Physics, random_state: np.random.RandomState
    ) -> None:
        """Stand at a start drawn around the world's, at cruise speed."""
        rng = np.random.default_rng(random_state.randint(2**31))
        start = draw_start(rng, self.world, self._car_config, self.config)
        data = physics.data.ptr
        data.qpos[:3] = start.x_m, start.y_m, start.heading_rad
        speed_mps = self._car_config.cruise_speed_mps
        data.qvel[:2] = (
            speed_mps * np.cos(start.heading_rad),
            speed_mps * np.sin(start.heading_rad),
        )
        self._controls = CarControls(data, self._car_config)
        self._referee = Referee(data, self.world)
        self._steps = 0
        self._touched = False
        self.outcome = Outcome.RUNNING

    def before_step(
        self,
        physics: mjcf.Physics,
        action: NDArray[np.float64],
        random_state: np.random.RandomState,
    ) -> None:
        """Hold the action for one control step."""
        del physics, random_state
        pedals = [float(pedal) for pedal in action[1:]]
        self._controls.apply(float(action[0]), *pedals)
        self._touched = False

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Look for a contact, which may last a single physics step."""
        del physics, random_state
        self._touched = self._touched or self._referee.touching()

    def after_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Count the step and decide the outcome."""
        del physics, random_state
        self._steps += 1
        self.outcome = self._referee.verdict(self._touched)
        if self.outcome is Outcome.RUNNING and self._steps >= self.config.max_steps:
            self.outcome = Outcome.TIME_LIMIT

    def should_terminate_episode(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, physics: mjcf.Physics
    ) -> bool:
        """Whether the outcome is not ``RUNNING``."""
        del physics
        return self.outcome is not Outcome.RUNNING

    def get_reward(self, physics: mjcf.Physics) -> float:
        """1 in the step that reaches the ball, else 0."""
        del physics
        return float(self.outcome is Outcome.BALL_REACHED)

    def get_discount(self, physics: mjcf.Physics) -> float:
        """0 where the episode truly ends, 1 elsewhere."""
        del physics
        return float(self.outcome in (Outcome.RUNNING, Outcome.TIME_LIMIT))

    def close(self) -> None:
        """Free the camera."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _image(self, physics: mjcf.Physics) -> NDArray[np.uint8]:
        model = physics.model.ptr
        if self._camera is None or self._camera.model is not model:  # composer may recompile
            self.close()
            self._camera = Camera(model, physics.data.ptr, self._camera_config)
        return self._camera.frame()


class DriveToBallEnvironment(composer.Environment):
    """A composer environment that also frees its camera."""

    def close(self) -> None:
        """Free the camera, then the physics."""
        if isinstance(self.task, DriveToBall):
            self.task.close()
        super().close()


def environment(
    world: WorldSpec,
    *,
    seed: int,
    car: CarConfig | None = None,
    config: DrivingConfig | None = None,
    camera: CameraConfig | None = None,
    pedals: bool = False,
) -> dm_env.Environment:
    """The task as a ``dm_env`` environment; for speed use ``Driving`` instead.

    Observations: ``car/pose`` (3,), ``car/velocity`` (3,), ``car/acceleration`` (2,) and, with a
    camera, ``image``. Call ``close`` when done.
    """
    task = DriveToBall(world, car=car, config=config, camera=camera, pedals=pedals)
    return DriveToBallEnvironment(
        task,
        random_state=np.random.RandomState(seed),
        recompile_mjcf_every_episode=False,
        strip_singleton_obs_buffer_dim=True,
        legacy_step=False,  # as `mj_step`, so that it agrees with `Driving` bit for bit
    )
