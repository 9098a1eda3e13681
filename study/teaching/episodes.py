"""From a drive's rows in the store back to the episode that a learner learns from."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

import numpy as np
import pyarrow as pa

from steerlab.learning.agents.contract import Episode, Targets
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, pool_frame
from steerlab.sim.records import Driver
from steerlab.sim.rollout import FloatArray, Outcome, Rollout
from steerlab.sim.tasks import HELD_STEPS

_POSE = ("x_m", "y_m", "heading_rad")
_VELOCITY = ("speed_mps", "lateral_speed_mps", "yaw_rate_radps")
_ACCELERATION = ("acceleration_x_mps2", "acceleration_y_mps2")


def rerender_observations(stage: TaskEnv, steps: pa.Table) -> Observations:
    """What the robot saw at each decision of a drive: the camera sees nothing but where it is."""
    rows = decisions(steps.num_rows)
    images = []
    for pose in _columns(steps, _POSE)[rows]:
        stage.driving.data.qpos[:3] = pose
        images.append(pool_frame(stage.frame()))
    motion = _columns(steps, (*_VELOCITY, *_ACCELERATION))[rows]
    return Observations(np.stack(images), motion.astype(np.float32))


def episode_of(
    steps: pa.Table, seen: Observations, outcome: Outcome, stage: TaskEnv, number: int
) -> Episode:
    """The episode of a finished attempt; its truth is what was kept beside each label.

    Args:
        number: of the round; in the first demonstration, 0, there is no robot's wheel.
    """
    rows = decisions(steps.num_rows)
    pose, truth = _columns(steps, _POSE), _values(steps, "oracle_label")
    robot = _values(steps, "robot_wheel")
    given = np.where(steps["label_valid"].to_numpy(), _values(steps, "teacher_label"), np.nan)
    driven = np.array(steps["gate"].to_pylist()) == Driver.TEACHER.value
    task = stage.task
    rollout = Rollout(
        name=steps["rollout"][0].as_py(),
        world=task.world,
        control_hz=task.driving.control_hz,
        seed=stage.seed,
        outcome=outcome,
        t_s=_values(steps, "t_s"),
        pose=pose,
        velocity=_columns(steps, _VELOCITY),
        acceleration=_columns(steps, _ACCELERATION),
        robot_wheel=robot,
        oracle_label=truth,
        oracle_valid=np.isfinite(truth),
        physics_state=np.zeros((steps.num_rows, 0)),
    )
    ball = np.array(task.world.ball_xy_m)
    return Episode(
        rollout=rollout,
        feedback=given,
        live=np.where(driven, given, np.nan),
        teacher_drives=driven[rows],
        seen=seen,
        rows=rows,
        learner_wheel=robot[rows] if number else np.full(len(rows), np.nan),
        doubt=np.full(len(rows), np.nan),
        final_distance_m=float(np.hypot(*(pose[-1, :2] - ball))),
        round_number=number,
        person=steps["participant"][0].as_py(),
    )


def decisions(steps: int) -> np.ndarray:
    """The control steps at which the robot decided."""
    return np.arange(0, steps, HELD_STEPS)


def errors(episode: Episode, targets: Targets) -> tuple[float | None, float | None]:
    """Mean error of what is imitated, and of what the person gave, over the rows asked for.

    Where nothing was asked, or nothing is known, there is none.
    """
    live, rows = episode.live[episode.rows], episode.rows
    given = np.where(np.isfinite(live), live, episode.feedback[rows])
    asked = targets.asked & np.isfinite(episode.truth)
    return (
        _mean_error(targets.target, episode.truth, asked),
        _mean_error(given, episode.truth, asked),
    )


def _mean_error(values: FloatArray, truth: FloatArray, rows: np.ndarray) -> float | None:
    error = np.abs(values - truth)[rows & np.isfinite(values)]
    return float(error.mean()) if len(error) else None


def _values(steps: pa.Table, name: str) -> FloatArray:
    """A column; null becomes NaN."""
    return steps[name].to_numpy().astype(np.float64)


def _columns(steps: pa.Table, names: tuple[str, ...]) -> FloatArray:
    return np.column_stack([_values(steps, name) for name in names])
