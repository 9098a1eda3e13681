"""What a mapper is pre-trained on: one drive's truth and the car's motion."""

from dataclasses import dataclass

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PretrainingDrive:
    """The truth of a rollout and the car's own motion.

    Attributes:
        truth: (steps,) oracle labels, all valid.
        motion: (steps, 3) yaw_rate_radps, speed_mps, robot_wheel, as ``series.CONTEXT``.
    """

    truth: FloatArray
    motion: FloatArray

    @classmethod
    def from_rollout(cls, rollout: Rollout) -> "PretrainingDrive":
        """What a mapper may know of a rollout.

        Raises:
            InvalidConfig: a step has no oracle label.
        """
        if not rollout.oracle_valid.all():
            raise InvalidConfig(f"Rollout {rollout.name!r} has steps without a label; drop it.")
        motion = np.column_stack(
            [rollout.velocity[:, 2], rollout.velocity[:, 0], rollout.robot_wheel]
        )
        return cls(truth=rollout.oracle_label, motion=motion)

    def mirrored(self) -> "PretrainingDrive":
        """Left and right exchanged; speed keeps its sign."""
        return PretrainingDrive(truth=-self.truth, motion=self.motion * np.array([-1.0, 1.0, -1.0]))
