"""From a drive's rows in the store back to the episode that a learner learns from."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

import numpy as np
import pyarrow as pa

from steerlab.learning.agents.contract import Episode
from steerlab.learning.agents.episode import decision_rows, make_episode, make_rollout
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, pool_frame
from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome

_POSE = ("x_m", "y_m", "heading_rad")
_VELOCITY = ("speed_mps", "lateral_speed_mps", "yaw_rate_radps")
_ACCELERATION = ("acceleration_x_mps2", "acceleration_y_mps2")


def rerender_observations(env: TaskEnv, steps: pa.Table) -> Observations:
    """What the robot saw at each decision of a drive: the camera sees nothing but where it is."""
    rows = decision_rows(steps.num_rows)
    images = []
    for pose in _columns(steps, _POSE)[rows]:
        env.driving.data.qpos[:3] = pose
        images.append(pool_frame(env.frame()))
    motion = _columns(steps, (*_VELOCITY, *_ACCELERATION))[rows]
    return Observations(np.stack(images), motion.astype(np.float32))


def episode_of(
    env: TaskEnv, steps: pa.Table, seen: Observations, outcome: Outcome, number: int
) -> Episode:
    """The episode of a finished attempt; its truth is what was kept beside each label.

    Args:
        number: of the round; 0 is the first demonstration.
    """
    given = np.where(steps["label_valid"].to_numpy(), _values(steps, "teacher_label"), np.nan)
    rollout = make_rollout(
        env,
        steps["rollout"][0].as_py(),
        outcome,
        pose=_columns(steps, _POSE),
        velocity=_columns(steps, _VELOCITY),
        acceleration=_columns(steps, _ACCELERATION),
        robot_wheel=_values(steps, "robot_wheel"),
        truth=_values(steps, "oracle_label"),
        physics_state=np.zeros((steps.num_rows, 0)),
    )
    return make_episode(
        rollout,
        teacher_wheel=given,
        teacher_drives=np.array(steps["gate"].to_pylist()) == Driver.TEACHER.value,
        feedback=given,
        seen=seen,
        number=number,
        person=steps["participant"][0].as_py(),
    )


def _values(steps: pa.Table, name: str) -> FloatArray:
    """A column; null becomes NaN."""
    return steps[name].to_numpy().astype(np.float64)


def _columns(steps: pa.Table, names: tuple[str, ...]) -> FloatArray:
    return np.column_stack([_values(steps, name) for name in names])
