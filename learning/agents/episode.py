"""Builds the episode that a learner learns from out of a finished drive's arrays."""

import numpy as np

from steerlab.learning.agents.contract import Episode, Targets
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.tasks import HELD_STEPS


def make_rollout(
    env: TaskEnv,
    name: str,
    outcome: Outcome,
    *,
    pose: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    robot_wheel: FloatArray,
    truth: FloatArray,
    physics_state: FloatArray,
) -> Rollout:
    """The rollout of a drive in ``env``, at each control step.

    Args:
        pose: (steps, 3) x_m, y_m, heading_rad.
        velocity, acceleration: (steps, 3) and (steps, 2), in the car's frame.
        robot_wheel: (steps,) what the learner asked for.
        truth: (steps,) ground truth; NaN where no path leads to the ball.
        physics_state: (steps, n); n is 0 where it was not kept.
    """
    hz = env.task.driving.control_hz
    return Rollout(
        name=name,
        world=env.task.world,
        control_hz=hz,
        seed=env.seed,
        outcome=outcome,
        t_s=np.arange(len(pose)) / hz,
        pose=pose,
        velocity=velocity,
        acceleration=acceleration,
        robot_wheel=robot_wheel,
        oracle_label=truth,
        oracle_valid=np.isfinite(truth),
        physics_state=physics_state,
    )


def make_episode(
    rollout: Rollout,
    *,
    teacher_wheel: FloatArray,
    teacher_drives: BoolArray,
    feedback: FloatArray,
    seen: Observations,
    number: int,
    person: str,
) -> Episode:
    """The episode that a label rule reads.

    Args:
        teacher_wheel: (steps,) the teacher's; NaN where there is none.
        teacher_drives: (steps,) whether it was the teacher's wheel that counted.
        feedback: (steps,) the teacher's labels for the whole drive.
        seen: at each decision.
        number: of the round; in the first demonstration, 0, no learner asks for a wheel.
    """
    rows = decision_rows(rollout.steps)
    return Episode(
        rollout=rollout,
        feedback=feedback,
        live=np.where(teacher_drives, teacher_wheel, np.nan),
        teacher_drives=teacher_drives[rows],
        seen=seen,
        rows=rows,
        learner_wheel=rollout.robot_wheel[rows] if number else np.full(len(rows), np.nan),
        round_number=number,
        person=person,
    )


def decision_rows(steps: int) -> np.ndarray:
    """The control steps, out of ``steps``, at which robot and gate decided."""
    return np.arange(0, steps, HELD_STEPS)


def label_errors(episode: Episode, targets: Targets) -> tuple[float | None, float | None]:
    """Mean errors over the rows asked for, in wheel units; None where nothing is known of any.

    Returns:
        of what is imitated, and of what the teacher gave.
    """
    live, rows = episode.live[episode.rows], episode.rows
    given = np.where(np.isfinite(live), live, episode.feedback[rows])
    asked = targets.asked & np.isfinite(episode.truth)
    return (
        _mean_error(targets.target, episode.truth, asked),
        _mean_error(given, episode.truth, asked),
    )


def _mean_error(values: FloatArray, truth: FloatArray, rows: BoolArray) -> float | None:
    error = np.abs(values - truth)[rows & np.isfinite(values)]
    return float(error.mean()) if len(error) else None
