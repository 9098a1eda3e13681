"""One teacher, one condition: the demonstration, then rounds of driving, labels and training."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from steerlab.learning.agents.common import TeacherDrives
from steerlab.learning.agents.contract import Agent, Episode, Targets
from steerlab.learning.agents.evaluation import DriveResult, evaluate
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.oracle import OracleLabelRule
from steerlab.learning.agents.play import Place, play
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import PolicyConfig
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.live_teacher import DrivingStyle, LiveTeacher, Responding
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS, Start, draw_task_start, redraw_noise

CALIBRATION_DRIVES = 12  # what a teacher has corrected before they teach


class BallNeverReached(SteerlabError):
    """A teacher who never gets to the ball cannot demonstrate; nothing can be learned from them."""


@dataclass(frozen=True, kw_only=True)
class TeachingConfig:
    """How long and how it is judged.

    Attributes:
        evaluate_every: rounds between evaluations; the last round always is.
        demonstrations: tries at the first demonstration before the teacher is given up.
    """

    rounds: int = 12
    evaluate_every: int = 2
    driving_style: DrivingStyle = "softened"
    demonstrations: int = 10
    policy: PolicyConfig = field(default_factory=PolicyConfig)
    training: PolicyTrainingConfig = field(default_factory=PolicyTrainingConfig)

    def __post_init__(self) -> None:
        for name in ("rounds", "evaluate_every", "demonstrations"):
            if getattr(self, name) < 1:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it must be at least 1.")


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundResult:
    """What a round asked of the teacher and left; round 0 is the demonstration.

    Attributes:
        label_mae: mean |target - truth| over the rows asked for; None where there is none.
        teacher_seconds: with the wheel in hand, labelling or driving.
        drives: evaluation drives after training; empty where this round was not evaluated.
        loss: last mean training loss; None where the gate let no label through.
    """

    round_number: int
    episode: Episode
    outcome: Outcome
    label_mae: float | None
    labels_asked: int
    teacher_seconds: float
    switches: int
    loss: float | None
    drives: list[DriveResult]


@dataclass(frozen=True, kw_only=True, eq=False)
class Judging:
    """Where policies are judged: a few starts on the way, and more at the end."""

    on_the_way: Sequence[Start]
    at_the_end: Sequence[Start]


def demonstrate(
    stage: TaskEnv, teacher: Responding, config: TeachingConfig, *, seed: int
) -> tuple[Episode, int]:
    """The first demonstration, redone with other noise until it reaches the ball.

    Returns:
        the demonstration, and how many tries failed before it.

    Raises:
        BallNeverReached: it never does.
    """
    live = LiveTeacher(teacher, config.driving_style)
    start = draw_task_start(stage.task, "teach", seed, 0)
    for attempt in range(config.demonstrations):
        place = _place(stage, seed, 0, attempt)
        noisy = redraw_noise(stage.task, start, seed, attempt)
        episode = play(
            stage, None, teacher, TeacherDrives(), noisy, place,
            live=live, rng=np.random.default_rng(0),
        )  # fmt: skip
        if episode.outcome is Outcome.BALL_REACHED:
            return episode, attempt
    raise BallNeverReached(
        f"{teacher.name} did not reach the ball of task {stage.task.name!r} in "
        f"{config.demonstrations} demonstrations ({config.driving_style} driving, noise "
        f"{stage.task.noise:g}); leave them out, or lower the noise."
    )


def teach(
    stage: TaskEnv,
    agent: Agent,
    teacher: Responding,
    demonstration: Episode,
    judging: Judging,
    config: TeachingConfig,
    *,
    seed: int,
    progress: Callable[[float], None],
) -> tuple[PolicyLearner, list[RoundResult]]:
    """Train one learner; starts, noise and initial weights depend on ``seed``, not on the agent.

    Raises:
        TrainingDiverged: a loss was not finite.
    """
    learner = PolicyLearner(
        seed,
        members=agent.ensemble,
        doubts=agent.doubts,
        policy=config.policy,
        training=config.training,
    )
    live = LiveTeacher(teacher, config.driving_style)
    collected: list[TrainingRows] = []
    results: list[RoundResult] = []
    for number in range(config.rounds + 1):
        if number == 0:
            episode = demonstration
            targets = _demonstrated(agent, demonstration, learner)
        else:
            episode = play(
                stage,
                learner,
                teacher,
                agent.gate,
                draw_task_start(stage.task, "teach", seed, number),
                _place(stage, seed, number, 0),
                live=live,
                rng=np.random.default_rng([seed, number, 0x6A7E]),
            )
            targets = agent.rule.target(episode, learner)
        rows = targets.rows(episode.seen)
        loss = None
        if rows is not None:  # a round in which nobody was asked leaves the policy as it is
            collected.append(rows)
            loss = learner.train(collected)
        last = number == config.rounds
        starts = judging.at_the_end if last else judging.on_the_way
        judged = last or number % config.evaluate_every == 0
        drives = evaluate(stage, learner, starts) if judged else []
        results.append(_result(number, episode, targets, loss, drives))
        progress((number + 1) / (config.rounds + 1))
    return learner, results


def _demonstrated(agent: Agent, episode: Episode, learner: PolicyLearner) -> Targets:
    """What everyone learns first: what the teacher did, never mapped (see ``mind_meld.py``)."""
    if agent.demonstration_is_oracle:
        return OracleLabelRule().target(episode, learner)
    label = episode.live[episode.rows]
    everywhere = np.ones(len(label), dtype=bool)
    return Targets(label, everywhere.astype(float), everywhere)


def _result(
    number: int,
    episode: Episode,
    targets: Targets,
    loss: float | None,
    drives: list[DriveResult],
) -> RoundResult:
    judged = targets.asked & np.isfinite(targets.target) & np.isfinite(episode.truth)
    error = np.abs(targets.target - episode.truth)[judged]
    asked = int(targets.asked.sum())
    return RoundResult(
        round_number=number,
        episode=episode,
        outcome=episode.outcome,
        label_mae=float(error.mean()) if len(error) else None,
        labels_asked=asked,
        teacher_seconds=asked * HELD_STEPS / episode.rollout.control_hz,
        switches=episode.switches,
        loss=loss,
        drives=drives,
    )


def _place(stage: TaskEnv, seed: int, number: int, attempt: int) -> Place:
    return Place(
        name=f"{stage.task.name}-s{seed}-r{number:02d}",
        round_number=number,
        order=CALIBRATION_DRIVES + number,
        attempt=attempt,
    )
