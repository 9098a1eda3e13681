"""A scripted teacher teaches as fast as the computer allows, and what happens stays in memory."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from steerlab.learning.agents.contract import Agent, Episode
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.evaluation import DriveResult
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.play import play
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
from steerlab.learning.policy_training import no_progress
from steerlab.sim.live_teacher import DriveContext, DrivingStyle, LiveTeacher, Responding
from steerlab.sim.rollout import Outcome

CALIBRATION_DRIVES = 12  # what a teacher has corrected before they teach


class MemoryLog:
    """A ``TeachingLog`` that ends with the process.

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
        """Keep a drive."""
        attempts = self.episodes.setdefault(episode.round_number, [])
        attempts.append(episode)
        return self._finished(episode, len(attempts) - 1)

    def next_drive(self, number: int) -> DriveContext:
        """Named by task, seed and round."""
        name = f"{self._env.task.name}-s{self._seed}-r{number:02d}"
        attempt = len(self.episodes.get(number, ()))
        order = CALIBRATION_DRIVES + number
        return self._env.context(name, number=number, order=order, attempt=attempt)

    def left_over(self, number: int) -> FinishedDrive | None:
        """A demonstration that is there before the loop begins."""
        attempts = self.episodes.get(number, ())
        return self._finished(attempts[-1], len(attempts) - 1) if attempts else None

    def episode(self, drive: FinishedDrive) -> Episode:
        """As it was added."""
        return self.episodes[drive.number][drive.attempt]

    def rounds(self) -> list[KeptRound]:
        """The rounds that are done."""
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
        """Keep a round; nobody trains its networks on: the next round trains a copy."""
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
    """A ``TeacherInterface`` that waits for nobody: drives, learns, evaluates, goes on.

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
        """To the end, and into memory."""
        return self._log.add(play(drive, self._teacher, self._live))

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> AfterRest:
        """Do both."""
        learn(no_progress)
        meanwhile(no_progress)
        self._on_round(number)
        return AfterRest.GO_ON

    def wait(self, what: str, work: Work) -> bool:
        """Do it."""
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
    found = demonstrate(env, log, drives, teacher=teacher.name, seed=seed, tries=config.tries)
    assert found is not None, "a script never stops"
    return log.episode(found), found.attempt


def teach_offline(
    env: TaskEnv,
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
