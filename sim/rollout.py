"""One recorded drive: what the car did at every control step, and how to restore it."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import WorldSpec


class Outcome(StrEnum):
    """Why a drive is over; ``RUNNING`` while it is not."""

    RUNNING = "running"
    BALL_REACHED = "ball_reached"
    BLOCK_HIT = "block_hit"
    OUT_OF_BOUNDS = "out_of_bounds"
    TIME_LIMIT = "time_limit"


@dataclass(frozen=True, kw_only=True, slots=True)
class Rollout:
    """Row ``t`` holds the state *before* the wheel ``robot_wheel[t]`` acted for one control step.

    Attributes:
        t_s: (steps,) time since the start, ``step / control_hz``.
        pose: (steps, 3) x_m, y_m, heading_rad of the car's centre in the world.
        velocity: (steps, 3) forward and leftward speed in m/s, yaw rate in rad/s; body frame.
        acceleration: (steps, 2) forward and leftward acceleration in m/s², body frame.
        robot_wheel: (steps,) the wheel position the robot applied.
        oracle_label: (steps,) ground truth ``o``; NaN where ``oracle_valid`` is False.
        oracle_valid: (steps,) False where no drivable path exists: masked, never labelled 0.
        physics_state: (steps, n) mjSTATE_INTEGRATION vectors; restoring one is bit-exact.
    """

    name: str
    world: WorldSpec
    control_hz: float
    seed: int
    outcome: Outcome
    t_s: FloatArray
    pose: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    robot_wheel: FloatArray
    oracle_label: FloatArray
    oracle_valid: BoolArray
    physics_state: FloatArray

    def __post_init__(self) -> None:
        steps = len(self.t_s)
        for name, columns in (("pose", 3), ("velocity", 3), ("acceleration", 2)):
            shape = getattr(self, name).shape
            if shape != (steps, columns):
                raise InvalidConfig(
                    f"Rollout {self.name!r}: {name} is {shape}, not {steps, columns}."
                )
        for name in ("robot_wheel", "oracle_label", "oracle_valid"):
            shape = getattr(self, name).shape
            if shape != (steps,):
                raise InvalidConfig(f"Rollout {self.name!r}: {name} is {shape}, not {(steps,)}.")
        if self.physics_state.ndim != 2 or len(self.physics_state) != steps:
            raise InvalidConfig(
                f"Rollout {self.name!r}: physics_state is {self.physics_state.shape}, "
                f"not ({steps}, state size)."
            )
        if np.isnan(self.oracle_label[self.oracle_valid]).any():
            raise InvalidConfig(f"Rollout {self.name!r}: a valid step has no oracle label.")

    @property
    def steps(self) -> int:
        """Number of control steps."""
        return len(self.t_s)

    def pose_at(self, step: int) -> Pose2D:
        """Where the car was before control step ``step``."""
        x_m, y_m, heading_rad = self.pose[step]
        return Pose2D(float(x_m), float(y_m), float(heading_rad))
