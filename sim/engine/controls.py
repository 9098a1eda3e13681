"""From a wheel position and pedals to MuJoCo's controls, once per control step."""

from math import atan, cos, sin, tan

import mujoco

from steerlab.sim.engine.car_state import StepMark, floats
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig

MIN_SLIP_SPEED_MPS = 2.0  # below it a slip angle is ill defined and the tyre becomes viscous
BRAKE_GAIN = 20_000.0  # N per m/s at full brake, before the clamp at max_brake_n


class CarControls:
    """Writes ``data.ctrl`` in the order of ``car.ACTUATORS``; holds views, copies nothing."""

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
