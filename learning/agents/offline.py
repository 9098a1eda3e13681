"""A scripted teacher teaches as fast as the computer allows; drives and rounds stay in memory."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from steerlab.learning.agents.contract import Agent, Episode, Watching
from steerlab.learning.agents.drive import HeldGate, Robot, RoundDrive
from steerlab.learning.agents.episode import make_episode, make_rollout
from steerlab.learning.agents.evaluation import DriveResult
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import (
    Judging,
    TeachingConfig,
    TeachingLoop,
    TeachingSpec,
    demonstrate,
)
from steerlab.learning.agents.teaching_contract import (
    AfterRest,
    FinishedDrive,
    KeptRound,
    RoundResult,
    Work,
)
from steerlab.learning.policy import PolicyNetwork
from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.live_teacher import DriveContext, DrivingStyle, LiveTeacher, Responding
from steerlab.sim.progress import ShareProgress, no_progress
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS

CALIBRATION_DRIVES = 12  # drives that a teacher has corrected before they teach


def play(drive: RoundDrive, teacher: Responding, live: LiveTeacher) -> Episode:
    """Drive from the start to the end; the teacher drives where the gate says so.

    Args:
        teacher: gives feedback on the whole drive afterwards, knowing all of it.
        live: the same person at the wheel, who knows only what has been.
    """
    env, context, driving = drive.env, drive.context, drive.env.driving
    reacting, untaught = drive.gate.watching is Watching.REACTING, drive.learner is None
    robot = Robot(env, drive.learner, doubts=drive.gate.needs_doubt)
    gate = HeldGate(drive.gate)
    states: list[DrivingState] = []
    physics: list[FloatArray] = []
    robot_wheel: list[float] = []
    hands: list[float] = []
    taught: list[bool] = []
    state = driving.reset(start=drive.start.pose)
    gate.begin(drive.number, drive.gate_rng(), Driver.TEACHER if untaught else Driver.ROBOT)
    if reacting:
        live.begin(context)
    for noise in np.repeat(drive.start.noise, HELD_STEPS).tolist():
        wheel = robot(state)
        truth = env.oracle(state) if reacting else nan
        hand = live.react(truth) if reacting else nan
        who = gate.who_drives(len(states), nan if untaught else wheel, hand, truth, robot.doubt)
        states.append(state)
        physics.append(driving.physics_state())
        robot_wheel.append(hand if untaught else wheel)
        hands.append(hand)
        taught.append(who is Driver.TEACHER)
        driving.step((hand if taught[-1] else wheel) + noise)
        state = driving.state
        if driving.outcome is not Outcome.RUNNING:
            break
    pose = np.array([(s.pose.x_m, s.pose.y_m, s.pose.heading_rad) for s in states])
    velocity = np.array([s.velocity for s in states])
    rollout = make_rollout(
        env,
        context.name,
        driving.outcome,
        pose=pose,
        velocity=velocity,
        acceleration=np.array([s.acceleration for s in states]),
        robot_wheel=np.array(robot_wheel),
        truth=env.planner.label_rollout(pose, velocity[:, 0]).wheel,
        physics_state=np.array(physics),
    )
    feedback = np.full(rollout.steps, nan)
    if rollout.oracle_valid.any():
        feedback = teacher.respond(rollout, order=context.order, attempt=context.attempt)
    return make_episode(
        rollout,
        teacher_wheel=np.array(hands),
        teacher_drives=np.array(taught),
        feedback=feedback,
        seen=robot.seen,
        number=drive.number,
        person=teacher.name,
    )


class MemoryLog:
    """A ``TeachingLog`` in memory.

    Args:
        seed: names drives apart.

    Attributes:
        episodes: of each round, one an attempt.
        results: of the rounds that are done.
    """

    def __init__(self, env: TaskEnv, seed: int) -> None:
        self._env, self._seed = env, seed
        self.episodes: dict[int, list[Episode]] = {}
        self.results: list[RoundResult] = []
        self._networks: list[Sequence[PolicyNetwork]] = []

    def add(self, episode: Episode) -> FinishedDrive:
        """Keep a finished drive."""
        attempts = self.episodes.setdefault(episode.round_number, [])
        attempts.append(episode)
        return self._finished(episode, len(attempts) - 1)

    def next_drive(self, number: int) -> DriveContext:
        """The next drive, named by task, seed and round."""
        name = f"{self._env.task.name}-s{self._seed}-r{number:02d}"
        attempt = len(self.episodes.get(number, ()))
        order = CALIBRATION_DRIVES + number
        return self._env.context(name, number=number, order=order, attempt=attempt)

    def left_over(self, number: int) -> FinishedDrive | None:
        """The demonstration that was added before the loop began, if this is its round."""
        attempts = self.episodes.get(number, ())
        return self._finished(attempts[-1], len(attempts) - 1) if attempts else None

    def episode(self, drive: FinishedDrive) -> Episode:
        """The episode of a finished drive."""
        return self.episodes[drive.number][drive.attempt]

    def rounds(self) -> list[KeptRound]:
        """The rounds that are done, in order."""
        return [
            KeptRound(
                number=result.round_number,
                evaluated=bool(result.drives),
                rows=lambda result=result: result.rows,
                networks=lambda networks=networks: networks,
            )
            for result, networks in zip(self.results, self._networks, strict=True)
        ]

    def keep(self, result: RoundResult, networks: Sequence[PolicyNetwork]) -> None:
        """Keep a round; its networks do not change, since the next round trains a copy."""
        self.results.append(result)
        self._networks.append(networks)

    def keep_drives(self, number: int, drives: Sequence[DriveResult]) -> None:
        """Keep how a round's policies drove."""
        self.results[number] = replace(self.results[number], drives=drives)

    def _finished(self, episode: Episode, attempt: int) -> FinishedDrive:
        return FinishedDrive(
            name=episode.rollout.name,
            number=episode.round_number,
            attempt=attempt,
            outcome=episode.outcome,
            seen=episode.seen,
        )


class ScriptedDrives:
    """A ``TeacherInterface`` that never waits: it drives, learns, evaluates and goes on.

    Args:
        style: how the teacher drives.
        on_round: told the number of each round that was learnt from.
    """

    def __init__(
        self,
        teacher: Responding,
        style: DrivingStyle,
        log: MemoryLog,
        on_round: Callable[[int], None] = lambda number: None,
    ) -> None:
        self._teacher, self._live = teacher, LiveTeacher(teacher, style)
        self._log, self._on_round = log, on_round

    def drive(self, drive: RoundDrive) -> FinishedDrive:
        """Play the drive to its end and keep it."""
        return self._log.add(play(drive, self._teacher, self._live))

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> AfterRest:
        """Learn and do the other work at once, without resting."""
        learn(no_progress)
        meanwhile(no_progress)
        self._on_round(number)
        return AfterRest.GO_ON

    def wait(self, what: str, work: Work) -> bool:
        """Do the work without reporting progress."""
        work(no_progress)
        return True


def demonstrate_offline(
    env: TaskEnv, teacher: Responding, config: TeachingConfig, *, seed: int
) -> tuple[Episode, int]:
    """The first demonstration.

    Returns:
        it, and how many tries failed before it.

    Raises:
        BallNeverReached: it never does.
    """
    log = MemoryLog(env, seed)
    drives = ScriptedDrives(teacher, config.driving_style, log)
    finished = demonstrate(env, log, drives, teacher=teacher.name, seed=seed, tries=config.tries)
    assert finished is not None, "a script never stops"
    return log.episode(finished), finished.attempt


def teach_offline(
    env: TaskEnv,
    agent: Agent,
    teacher: Responding,
    demonstration: Episode,
    judging: Judging,
    config: TeachingConfig,
    *,
    seed: int,
    progress: ShareProgress,
) -> tuple[PolicyLearner, list[RoundResult]]:
    """Train one learner; starts, noise and initial weights depend on ``seed``, not on the agent.

    Args:
        demonstration: what every learner of this teacher and seed begins with.

    Raises:
        RoundDiverged: a loss was not finite.
    """
    log = MemoryLog(env, seed)
    log.add(demonstration)
    spec = TeachingSpec(
        teacher=teacher.name, agent=agent, config=config, judging=judging, seed=seed
    )
    drives = ScriptedDrives(
        teacher,
        config.driving_style,
        log,
        lambda number: progress((number + 1) / (config.rounds + 1)),
    )
    loop = TeachingLoop(spec, env, log, drives)
    loop.run()
    return loop.learner, log.results
