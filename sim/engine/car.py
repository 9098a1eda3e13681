"""The car: its MJCF, the controls that drive it, and its state read back from MuJoCo.

A planar chassis is pushed by four tyre actuators whose law runs inside MuJoCo. Against a dynamic
bicycle its turning radius errs by about 2 %; it cannot flip, drives exactly straight hands-off and
costs 5 µs a physics step, where a contact car costs 14-33 µs. The first three joints are x, y and
yaw in the world; ``mjData.userdata``, part of ``mjSTATE_INTEGRATION``, carries what the
acceleration needs.
"""

from math import atan, cos, pi, sin, tan
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from steerlab.sim.camera_config import viewpoints
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig

GRAVITY_MPS2 = 9.81
IMU_HEIGHT_M = 0.4
AXLE_HEIGHT_M = 0.33
KNUCKLE_RANGE_RAD = 0.78  # the inner wheel turns further than the mean (Ackermann)
TYRE_CTRL_MAX = 1e6
ACTUATORS = ("steer_fl", "steer_fr", "drive", "brake", "tyre_fl", "tyre_fr", "tyre_rl", "tyre_rr")
_PAINT = "0.80 0.12 0.14 1"
_GLASS = "0.15 0.20 0.25 1"
_RUBBER = "0.08 0.08 0.08 1"
# Groups of geoms: only the chase camera draws the car, only the driver's camera the hood (a group
# that no camera draws by default).
CAR_GROUP, HOOD_GROUP = 1, 3
# A real shadow pass costs 30 ms a frame, translucency 0.2 ms; a dark box on plain ground neither.
SHADOW_RGBA = "0.22 0.23 0.22 1"
MIN_SLIP_SPEED_MPS = 2.0  # below it a slip angle is ill defined and the tyre becomes viscous
BRAKE_GAIN = 20_000.0  # N per m/s at full brake, before the clamp at max_brake_n
USERDATA_SIZE = 3  # world velocity x, y and time at the start of the last control step


def numbers(*values: float) -> str:
    """``values`` for an MJCF attribute, each written so that it is read back to the bit."""
    return " ".join(repr(float(value)) for value in values)


def car_mjcf(config: CarConfig) -> str:
    """MJCF of the car; attach it at the world's origin, its pose lives in the joints x, y and yaw."""
    return f"""
<mujoco model="car">
  <compiler angle="radian"/>
  <worldbody>
    <body name="chassis">
      <inertial pos="{numbers(0, 0, IMU_HEIGHT_M)}" mass="{numbers(config.mass_kg)}"
        diaginertia="{numbers(400, 1600, config.yaw_inertia_kgm2)}"/>
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="yaw" type="hinge" axis="0 0 1"/>
      <site name="imu" pos="{numbers(0, 0, IMU_HEIGHT_M)}"/>
      {_hull(config)}
      {_wheels(config)}
      {_cameras(config)}
    </body>
  </worldbody>
  <actuator>
    {_actuators(config)}
  </actuator>
</mujoco>
"""


def _cameras(config: CarConfig) -> str:
    return "\n      ".join(
        f'<camera name="{view}" pos="{numbers(at.x_m, 0, at.z_m)}" mode="fixed" '
        f'xyaxes="{numbers(0, -1, 0, at.down, 0, 1)}" fovy="{numbers(at.fov_deg)}"/>'
        for view, at in viewpoints(config).items()
    )


def _hull(config: CarConfig) -> str:
    """The chassis, the only part that touches anything, and what is only drawn."""
    length, width = config.length_m / 2, config.width_m / 2
    drawn = "\n      ".join(
        f'<geom name="{part}" type="box" size="{numbers(*size)}" pos="{numbers(*pos)}" '
        f'rgba="{rgba}" contype="0" conaffinity="0" group="{CAR_GROUP}"/>'
        for part, size, pos, rgba in (
            ("cabin", (0.42 * length, 0.88 * width, 0.24), (-0.25, 0, 1.1), _GLASS),
            ("roof", (0.36 * length, 0.84 * width, 0.03), (-0.25, 0, 1.36), _PAINT),
            ("shadow", (1.04 * length, 1.1 * width, 0.01), (-0.05, 0, 0.03), SHADOW_RGBA),
        )
    )
    return f"""<geom name="chassis" type="box" size="{numbers(length, width, 0.28)}" pos="0 0 0.6"
        rgba="{_PAINT}" contype="2" conaffinity="1" friction="0.3 0.005 0.0001"
        group="{CAR_GROUP}"/>
      {drawn}"""


def _wheels(config: CarConfig) -> str:
    """Front wheels turn on knuckles; a tyre's force acts at the site that has the wheel's name."""
    half_base_m, half_track_m = config.wheelbase_m / 2, config.track_m / 2

    def wheel(name: str, x_m: float, y_m: float, z_m: float) -> str:
        return (
            f'<site name="{name}" pos="{numbers(x_m, y_m, z_m)}"/>'
            f'<geom name="wheel_{name}" type="cylinder" pos="{numbers(x_m, y_m * 1.12, z_m)}" '
            f'size="{numbers(AXLE_HEIGHT_M, 0.13)}" euler="{numbers(pi / 2, 0, 0)}" '
            f'rgba="{_RUBBER}" contype="0" conaffinity="0" group="{CAR_GROUP}"/>'
        )

    def knuckle(name: str, y_m: float) -> str:
        return f"""<body name="knuckle_{name}" pos="{numbers(half_base_m, y_m, AXLE_HEIGHT_M)}">
        <inertial pos="0 0 0" mass="0.01" diaginertia="0.01 0.01 0.01"/>
        <joint name="steer_{name}" axis="0 0 1" limited="true"
          range="{numbers(-KNUCKLE_RANGE_RAD, KNUCKLE_RANGE_RAD)}" armature="1" damping="1"/>
        {wheel(name, 0, 0, 0)}
      </body>"""

    return "\n      ".join(
        (
            knuckle("fl", half_track_m),
            knuckle("fr", -half_track_m),
            wheel("rl", -half_base_m, half_track_m, AXLE_HEIGHT_M),
            wheel("rr", -half_base_m, -half_track_m, AXLE_HEIGHT_M),
        )
    )


def _actuators(config: CarConfig) -> str:
    """MJCF of the actuators, in the order of ``ACTUATORS``.

    The engine's force is 6000 times (target speed - speed), within what an engine can do; brake
    and tyres are viscous: force = -ctrl * speed of the site along the gear, clamped.
    """
    tyre_limit_n = config.friction * config.mass_kg * GRAVITY_MPS2 / 4.0
    steering = [
        f'<position name="steer_{name}" joint="steer_{name}" kp="400" kv="40" ctrllimited="true" '
        f'ctrlrange="{numbers(-KNUCKLE_RANGE_RAD, KNUCKLE_RANGE_RAD)}"/>'
        for name in ("fl", "fr")
    ]
    drive = (
        '<general name="drive" site="imu" gear="1 0 0 0 0 0" gainprm="6000" biastype="affine" '
        'biasprm="0 0 -6000" forcelimited="true" forcerange="-6000 4000"/>'
    )

    def viscous(name: str, site: str, gear: str, limit_n: float) -> str:
        return (
            f'<general name="{name}" site="{site}" gear="{gear}" gaintype="affine" '
            f'gainprm="0 0 -1" biastype="none" ctrllimited="true" '
            f'ctrlrange="{numbers(0, TYRE_CTRL_MAX)}" forcelimited="true" '
            f'forcerange="{numbers(-limit_n, limit_n)}"/>'
        )

    brake = viscous("brake", "imu", "1 0 0 0 0 0", config.max_brake_n)
    tyres = [
        viscous(f"tyre_{name}", name, "0 1 0 0 0 0", tyre_limit_n)
        for name in ("fl", "fr", "rl", "rr")
    ]
    return "\n    ".join([*steering, drive, brake, *tyres])


class CarControls:
    """Writes ``data.ctrl`` in the order of ``ACTUATORS``; holds views, copies nothing."""

    def __init__(self, data: mujoco.MjData, config: CarConfig) -> None:
        self._qpos = floats(data.qpos)
        self._qvel = floats(data.qvel)
        self._ctrl = floats(data.ctrl)
        self._mark = StepMark(data)
        self._cruise_mps = config.cruise_speed_mps
        self._max_mps = config.max_speed_mps
        self._rad_per_wheel = config.full_lock_rad / WHEEL_LIMIT
        self._wheelbase_m = config.wheelbase_m
        self._half_track_m = config.track_m / 2.0
        self._tyre_stiffness_n = config.cornering_stiffness_n / 2.0  # two tyres an axle

    def apply(self, wheel: float, throttle: float | None = None, brake: float = 0.0) -> None:
        """Set the controls; ``wheel`` is clipped to ±WHEEL_LIMIT, the pedals to [0, 1].

        Without a throttle the car cruises at the paper's constant speed.
        """
        self._mark.set()
        ctrl, half_track_m = self._ctrl, self._half_track_m
        wheel = min(WHEEL_LIMIT, max(-WHEEL_LIMIT, wheel))
        slope = tan(wheel * self._rad_per_wheel)  # Ackermann: both axles turn about one centre
        reach_m = self._wheelbase_m * slope
        ctrl[0] = atan(reach_m / (self._wheelbase_m - half_track_m * slope))
        ctrl[1] = atan(reach_m / (self._wheelbase_m + half_track_m * slope))
        target_mps = self._cruise_mps
        if throttle is not None:
            target_mps = min(1.0, max(0.0, throttle)) * self._max_mps
        brake = min(1.0, max(0.0, brake))
        ctrl[2] = target_mps * (1.0 - brake)  # the engine does not push against the brake
        ctrl[3] = brake * BRAKE_GAIN
        heading_rad = self._qpos[2]
        forward_mps = cos(heading_rad) * self._qvel[0] + sin(heading_rad) * self._qvel[1]
        # F = -C * slip angle, with the slip angle taken as lateral over forward speed
        stiffness = self._tyre_stiffness_n / max(abs(forward_mps), MIN_SLIP_SPEED_MPS)
        ctrl[4] = ctrl[5] = ctrl[6] = ctrl[7] = stiffness


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
        """Store velocity and time; call at the start of each control step."""
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
