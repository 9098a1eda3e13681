"""Camera pictures for a recording, drawn from the stored poses after the drive."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from io import BytesIO
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec

PICTURES_HZ = 10.0  # enough to follow by eye; 14 MB a minute at 20 Hz and full size
JPEG_QUALITY = 75


class View(Protocol):
    """Draws a world with the car anywhere in it, such as ``steerlab.sim.engine.world_view``."""

    def frame(self, pose: Pose2D, road_wheel_rad: float = 0.0) -> NDArray[np.uint8]:
        """(height, width, 3) RGB, top row first."""
        ...


OpenView = Callable[[WorldSpec], AbstractContextManager[View]]
"""Prepares to draw a world: slow, and it holds an OpenGL context until it is closed."""


def shown_steps(steps: Sequence[LabelledStep], control_hz: float) -> Sequence[LabelledStep]:
    """Those that get a picture."""
    return steps[:: max(1, round(control_hz / PICTURES_HZ))]


def jpegs(view: View, steps: Sequence[LabelledStep], car: CarConfig | None = None) -> list[bytes]:
    """A JPEG file for each step."""
    car = car or CarConfig()
    drawn: list[bytes] = []
    for step in steps:
        pose = Pose2D(step.x_m, step.y_m, step.heading_rad)
        file = BytesIO()
        frame = view.frame(pose, car.road_wheel_rad(step.executed_wheel))
        Image.fromarray(frame).save(file, "JPEG", quality=JPEG_QUALITY)
        drawn.append(file.getvalue())
    return drawn
