"""A world drawn with the car at any pose, without physics: for replays and for the screen."""

from math import atan, tan
from types import TracebackType

import mujoco
import numpy as np
from numpy.typing import NDArray

from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.scene import compose
from steerlab.sim.engine.scenery import add_scenery
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec

_JOINTS = ("x", "y", "yaw", "steer_fl", "steer_fr")


class WorldView:
    """Builds the scene once (slow), then draws frames (fast); nothing in it moves by itself.

    Args:
        scenery: False draws the bare scene that is simulated and that policies see.

    Raises:
        NoRenderer: this machine has no OpenGL back end that can draw offscreen.
    """

    def __init__(
        self,
        world: WorldSpec,
        camera: CameraConfig | None = None,
        *,
        car: CarConfig | None = None,
        scenery: bool = True,
    ) -> None:
        self.world = world
        self._car = car or CarConfig()
        spec = compose(world, self._car)
        if scenery:
            add_scenery(spec, world, self._car)
        model: mujoco.MjModel = spec.compile()
        self._data = mujoco.MjData(model)
        self._places = [int(model.joint(f"car/{name}").qposadr[0]) for name in _JOINTS]
        self._camera = Camera(model, self._data, camera)
        self._open = True

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of a frame."""
        return self._camera.config.width, self._camera.config.height

    def frame(
        self,
        pose: Pose2D,
        road_wheel_rad: float = 0.0,
        out: NDArray[np.uint8] | None = None,
    ) -> NDArray[np.uint8]:
        """Draw the car at ``pose`` with its front wheels turned, positive to the left.

        Returns:
            (height, width, 3) RGB, top row first: ``out`` if given, else a buffer that the next
            call overwrites.

        Raises:
            NoRenderer: the view is closed.
        """
        if self._open:
            left_rad, right_rad = ackermann_rad(self._car, road_wheel_rad)
            self._data.qpos[self._places] = (
                pose.x_m,
                pose.y_m,
                pose.heading_rad,
                left_rad,
                right_rad,
            )
        return self._camera.frame(out)

    def close(self) -> None:
        """Free the OpenGL context; calling it again does nothing."""
        if self._open:
            self._open = False
            self._camera.close()

    def __enter__(self) -> "WorldView":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def ackermann_rad(car: CarConfig, road_wheel_rad: float) -> tuple[float, float]:
    """Left and right front wheel of a car whose axles turn about one centre.

    Args:
        road_wheel_rad: of the wheel midway between the two, positive to the left.
    """
    slope = tan(road_wheel_rad)
    reach_m, half_track_m = car.wheelbase_m * slope, car.track_m / 2.0 * slope
    return atan(reach_m / (car.wheelbase_m - half_track_m)), atan(
        reach_m / (car.wheelbase_m + half_track_m)
    )
