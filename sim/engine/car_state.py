"""Read the car's state from MuJoCo: the first three joints are x, y and yaw in the world.

``mjData.userdata``, part of ``mjSTATE_INTEGRATION``, carries what the acceleration needs.
"""

from math import cos, sin
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

USERDATA_SIZE = 3  # world velocity x, y and time at the start of the last control step


def pose(data: mujoco.MjData) -> NDArray[np.float64]:
    """(3,) x_m, y_m, heading_rad of the car's centre."""
    return data.qpos[:3].copy()


def velocity(data: mujoco.MjData) -> NDArray[np.float64]:
    """(3,) forward and leftward speed in m/s, yaw rate in rad/s; body frame."""
    forward, left = _into_body(data, data.qvel)
    return np.array((forward, left, data.qvel[2]))


def floats(array: Any) -> "memoryview[float]":
    """A view of a float64 array whose items are read and written three times faster."""
    return memoryview(array)


class StepMark:
    """Remembers velocity and time at the start of a control step, where a restore keeps them.

    MuJoCo's ``qacc`` (and so its accelerometer) is of no use here: the tyres are stiff, and the
    implicit integrator takes a step that is up to a sixth smaller than ``qacc`` says.
    """

    def __init__(self, data: mujoco.MjData) -> None:
        self._data = data
        self._qvel = floats(data.qvel)
        self._userdata = floats(data.userdata)

    def set(self) -> None:
        """Call at the start of each control step."""
        userdata, qvel = self._userdata, self._qvel
        userdata[0] = qvel[0]
        userdata[1] = qvel[1]
        userdata[2] = self._data.time


def acceleration(data: mujoco.MjData) -> NDArray[np.float64]:
    """(2,) forward and leftward mean acceleration in m/s² over the last control step; body frame."""
    elapsed_s = data.time - data.userdata[2]
    if elapsed_s <= 0.0:  # at the very start
        return np.zeros(2)
    return np.array(_into_body(data, (data.qvel[:2] - data.userdata[:2]) / elapsed_s))


def _into_body(data: mujoco.MjData, world: NDArray[np.float64]) -> tuple[float, float]:
    heading_rad = data.qpos[2]
    cosine, sine = cos(heading_rad), sin(heading_rad)
    x, y = float(world[0]), float(world[1])
    return cosine * x + sine * y, cosine * y - sine * x
