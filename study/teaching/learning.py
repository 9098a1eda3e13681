"""A learner of a study's condition: new, from the policies and rows that are kept, and warmed up."""

import numpy as np

from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows
from steerlab.study.teaching.episodes import rerender_observations
from steerlab.study.teaching.plan import TeachPlan
from steerlab.study.teaching.teacher_interface import Tick
from steerlab.study.teaching.teaching_log import TeachingLog


def new_learner(agent: Agent, plan: TeachPlan, seed: int) -> PolicyLearner:
    """Of a condition; the weights depend on ``seed`` alone."""
    return PolicyLearner(
        seed,
        members=agent.ensemble,
        doubts=agent.doubts,
        training=PolicyTrainingConfig(steps=plan.gradient_steps, rate=plan.rate),
    )


def restore_learner(
    learner: PolicyLearner, register: TeachingLog, stage: TaskEnv, tick: Tick
) -> list[TrainingRows]:
    """Bring a new learner to where the last round that was kept left it.

    It is trained anew on the rows of each round, which also brings back what the policies' files
    do not hold (the state of its randomness, what it doubts by); its weights are then the kept
    ones, so that another machine's rounding does not make another robot.

    Returns:
        the rows of each round that had any.

    Raises:
        TeachingError: a policy is missing or was changed.
    """
    rounds = register.taught()
    collected: list[TrainingRows] = []
    for done, taught in enumerate(rounds):
        tick(done / len(rounds))
        targets = register.targets(taught)
        kept = targets.weight > 0.0
        if kept.any():
            seen = rerender_observations(stage, register.steps(taught.rollout, taught.attempt))
            collected.append(
                TrainingRows(seen.take(kept), targets.target[kept], targets.weight[kept])
            )
            learner.train(collected)
    if rounds:
        learner.load(register.load(rounds[-1]))
    return collected


def warm_up(stage: TaskEnv, agent: Agent) -> None:
    """Do once what takes seconds the first time: the person rests no longer for it.

    Imports and compiles; nothing of it stays in the learner that is taught.
    """
    stage.oracle(stage.driving.state)
    seen = stage.look()
    idle = PolicyLearner(
        0,
        members=agent.ensemble,
        doubts=agent.doubts,
        training=PolicyTrainingConfig(steps=2, batch_size=1),
    )
    rows = TrainingRows(seen, np.zeros(1), np.ones(1))
    idle.act(seen)
    idle.train([rows, rows])
