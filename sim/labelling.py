"""From a rollout and a teacher's labels for it to ``LabelledStep`` records and tables."""

import numpy as np
import pyarrow as pa

from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import Driver, LabelledStep, table_from_columns
from steerlab.sim.rollout import Rollout


def labelled_table(
    rollout: Rollout, labels: FloatArray, *, participant: str, attempt: int = 0
) -> pa.Table:
    """One row a step, of ``LABELLED_STEP_SCHEMA``.

    Args:
        labels: (steps,) the teacher's; NaN where the device gave none, which becomes null.
    """
    steps = rollout.steps
    given = ~np.isnan(labels)
    speed, slip, yaw_rate = rollout.velocity.T
    acceleration_x, acceleration_y = rollout.acceleration.T
    x_m, y_m, heading_rad = rollout.pose.T
    return table_from_columns(
        {
            "participant": [participant] * steps,
            "rollout": [rollout.name] * steps,
            "attempt": np.full(steps, attempt, np.int32),
            "step": np.arange(steps, dtype=np.int32),
            "t_s": rollout.t_s,
            "x_m": x_m,
            "y_m": y_m,
            "heading_rad": heading_rad,
            "speed_mps": speed,
            "lateral_speed_mps": slip,
            "yaw_rate_radps": yaw_rate,
            "acceleration_x_mps2": acceleration_x,
            "acceleration_y_mps2": acceleration_y,
            "robot_wheel": rollout.robot_wheel,
            "teacher_label": pa.array(labels, mask=~given),
            "oracle_label": pa.array(rollout.oracle_label, mask=~rollout.oracle_valid),
            "executed_wheel": rollout.robot_wheel,  # a replay shows what the robot did
            "gate": [str(Driver.ROBOT)] * steps,
            "label_valid": given,
        }
    )


def labelled_step(
    rollout: Rollout, step: int, label: float | None, *, participant: str, attempt: int = 0
) -> LabelledStep:
    """The record of one step; equal to the row of ``labelled_table``."""
    x_m, y_m, heading_rad = rollout.pose[step].tolist()
    speed, slip, yaw_rate = rollout.velocity[step].tolist()
    acceleration_x, acceleration_y = rollout.acceleration[step].tolist()
    wheel = float(rollout.robot_wheel[step])
    return LabelledStep(
        participant=participant,
        rollout=rollout.name,
        attempt=attempt,
        step=step,
        t_s=float(rollout.t_s[step]),
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        speed_mps=speed,
        lateral_speed_mps=slip,
        yaw_rate_radps=yaw_rate,
        acceleration_x_mps2=acceleration_x,
        acceleration_y_mps2=acceleration_y,
        robot_wheel=wheel,
        teacher_label=label,
        oracle_label=float(rollout.oracle_label[step]) if rollout.oracle_valid[step] else None,
        executed_wheel=wheel,
        gate=Driver.ROBOT,
        label_valid=label is not None,
    )
