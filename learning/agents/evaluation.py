"""How well a policy drives: from all starts in lock step, with one batched call of the network."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.agents.contract import Learner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, stack
from steerlab.sim.arrays import FloatArray
from steerlab.sim.progress import ShareProgress, no_progress
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS, Start


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """How one evaluation drive went; ``path_m`` is (points, 2), a point each half second."""

    outcome: Outcome
    final_distance_m: float
    path_m: FloatArray


class _Car:
    """One start's state while the one simulator serves the others."""

    def __init__(self, env: TaskEnv, start: Start) -> None:
        env.driving.reset(start=start.pose)
        self.noise = start.noise
        self.physics = env.driving.physics_state()
        self.seen: Observations = env.look()
        self.path: list[tuple[float, float]] = []
        self.outcome = Outcome.RUNNING
        self.distance_m = env.driving.distance_to_ball_m
        self.mark(env)

    def mark(self, env: TaskEnv) -> None:
        pose = env.driving.state.pose
        self.path.append((pose.x_m, pose.y_m))

    def drive(self, env: TaskEnv, decision: int, wheel: float) -> None:
        driving = env.driving
        driving.restore(self.physics)
        for _ in range(HELD_STEPS):
            if driving.step(wheel + float(self.noise[decision])) is not Outcome.RUNNING:
                break
        self.outcome, self.distance_m = driving.outcome, driving.distance_to_ball_m
        over = self.outcome is not Outcome.RUNNING
        if over or decision % 5 == 4:
            self.mark(env)
        if not over:
            self.physics = driving.physics_state()
            self.seen = env.look()


def evaluate(
    env: TaskEnv, learner: Learner, starts: Sequence[Start], progress: ShareProgress = no_progress
) -> list[DriveResult]:
    """Drive the learner from each of ``starts`` under its noise, without a teacher.

    Args:
        progress: told the share of the time limit at each decision; what it raises ends the
            evaluation.
    """
    cars = [_Car(env, start) for start in starts]
    for decision in range(env.task.decisions):
        running = [car for car in cars if car.outcome is Outcome.RUNNING]
        if not running:
            break
        progress((decision + 1) / env.task.decisions)
        wheels = learner.act(stack([car.seen for car in running]))
        for car, wheel in zip(running, wheels.tolist(), strict=True):
            car.drive(env, decision, wheel)
    return [DriveResult(car.outcome, car.distance_m, np.array(car.path)) for car in cars]
