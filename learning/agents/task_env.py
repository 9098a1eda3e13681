"""A task made ready to drive: physics, camera and ground truth of one world, in one process."""

from types import TracebackType

import numpy as np

from steerlab.learning.policy import CAMERA_PX, Frames, Observations, pool_frame
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving, DrivingState
from steerlab.sim.errors import NoPath
from steerlab.sim.ground_truth import Planner
from steerlab.sim.live_teacher import DriveContext
from steerlab.sim.tasks import Screened, Task, screen_starts


class TaskEnv:
    """Physics, planner and camera, each slow to make; not thread-safe. Close it when done.

    Args:
        seed: of the planner's trees and of the screened starts.
    """

    def __init__(self, task: Task, *, seed: int) -> None:
        self.task = task
        self.seed = seed
        self.driving = Driving(task.world, car=task.car, config=task.driving)
        self.planner = Planner(task.world, seed=seed, car=task.car, config=task.planning)
        self._camera: Camera | None = None

    def screened(self, count: int, *entropy: object) -> Screened:
        """Starts that the noisy oracle reaches the ball from; see ``screen_starts``."""
        return screen_starts(self.task, self.planner, self.driving, count, self.seed, *entropy)

    def look(self) -> Observations:
        """What a policy sees now, one row."""
        state = self.driving.state
        return Observations(pool_frame(self.frame())[None], motion_of(state)[None])

    def frame(self) -> Frames:
        """(64, 64, 3) what the car's camera sees; the next call overwrites it."""
        if self._camera is None:  # tests of what needs no image do without OpenGL
            camera = CameraConfig(width=CAMERA_PX, height=CAMERA_PX)
            self._camera = Camera(self.driving.model, self.driving.data, camera)
        return self._camera.frame()

    def context(self, name: str, *, number: int, order: int, attempt: int) -> DriveContext:
        """The context of a drive of round ``number`` in this task."""
        config = self.task.driving
        return DriveContext(
            name=name,
            order=order,
            attempt=attempt,
            steps=config.max_steps,
            control_hz=config.control_hz,
            round_number=number,
        )

    def oracle(self, state: DrivingState) -> float:
        """Ground truth for a state; NaN where no path leads to the ball."""
        try:
            return self.planner.label(state.pose, float(state.velocity[0]))
        except NoPath:
            return float("nan")

    def close(self) -> None:
        """Free camera and model."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
        self.driving.close()

    def __enter__(self) -> "TaskEnv":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def motion_of(state: DrivingState) -> np.ndarray:
    """(5,) float32: velocity and acceleration in the car's frame."""
    return np.concatenate([state.velocity, state.acceleration]).astype(np.float32)
