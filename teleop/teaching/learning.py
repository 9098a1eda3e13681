"""Training with progress, and a learner from the policies and rows that are kept."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from torch.optim.optimizer import register_optimizer_step_post_hook

from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.stage import Stage
from steerlab.learning.policy import PolicyNetwork
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows
from steerlab.teleop.teaching.episodes import see_again
from steerlab.teleop.teaching.host import Tick
from steerlab.teleop.teaching.plan import TeachPlan
from steerlab.teleop.teaching.register import Register


def new_learner(agent: Agent, plan: TeachPlan, seed: int) -> PolicyLearner:
    """Of a condition; the weights depend on ``seed`` alone."""
    return PolicyLearner(
        seed,
        members=agent.ensemble,
        doubts=agent.doubts,
        training=PolicyTrainingConfig(steps=plan.gradient_steps, rate=plan.rate),
    )


def with_policies(learner: PolicyLearner, networks: Sequence[PolicyNetwork]) -> PolicyLearner:
    """The learner, its weights replaced."""
    for mine, kept in zip(learner.networks, networks, strict=True):
        mine.load_state_dict(kept.state_dict())
    return learner


def train(learner: PolicyLearner, rows: Sequence[TrainingRows], steps: int, tick: Tick) -> float:
    """Train, and tell ``tick`` how far it is; whatever that raises ends the training.

    Args:
        steps: of each of the learner's policies.

    Raises:
        TrainingDiverged: the loss is not finite.
    """
    with _counted(steps * len(learner.networks), tick):
        return learner.train(rows)


def learn_again(
    learner: PolicyLearner, register: Register, stage: Stage, steps: int, tick: Tick
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
            seen = see_again(stage, register.steps(taught.rollout, taught.attempt))
            collected.append(
                TrainingRows(seen.take(kept), targets.target[kept], targets.weight[kept])
            )
            train(learner, collected, steps, lambda share: None)
    if rounds:
        with_policies(learner, register.load(rounds[-1]))
    return collected


@contextmanager
def _counted(steps: int, tick: Tick) -> Iterator[None]:
    """Count the optimiser's steps; PyTorch calls the hook after each."""
    done = 0

    def count(*_: object) -> None:
        nonlocal done
        done += 1
        tick(min(1.0, done / steps))

    hook = register_optimizer_step_post_hook(count)
    try:
        yield
    finally:
        hook.remove()


def warm_up(stage: Stage, agent: Agent) -> None:
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
