"""One loop in which anyone teaches: the first demonstration, then rounds of drive and learning.

Who teaches and in which time is the interface's matter, where it is kept the log's. Everything
else, such as who labels what, what is trained on and what is evaluated, is decided here.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from time import perf_counter

from steerlab.learning.agents.contract import Agent, Episode, Targets
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.episode import label_errors
from steerlab.learning.agents.evaluation import DriveResult, evaluate
from steerlab.learning.agents.gates import TeacherDrives
from steerlab.learning.agents.label_rules import OracleLabelRule, WhereTeacherDrives
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching_contract import (
    AfterRest,
    DriveLog,
    FinishedDrive,
    RoundResult,
    TeacherInterface,
    TeachingLog,
)
from steerlab.learning.policy import PolicyConfig
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingDiverged, TrainingRows
from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.live_teacher import DrivingStyle
from steerlab.sim.progress import ShareProgress
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS, Start

REMEMBERING = "The robot remembers what it was taught"
TRYING = "That is all. The robot tries out what it has learnt, and the window closes by itself"


class BallNeverReached(SteerlabError):
    """A teacher who never gets to the ball cannot demonstrate; nothing can be learned from them."""


class NothingShown(SteerlabError):
    """The first demonstration holds no label."""


class RoundDiverged(TrainingDiverged):
    """A round cannot be learnt from; its drive is kept, and the learner is as it was before it."""

    def __init__(self, round_number: int, why: str) -> None:
        super().__init__(why)
        self.round_number = round_number


@dataclass(frozen=True, kw_only=True)
class TeachingConfig:
    """How long it is taught, and how.

    Attributes:
        rounds: after the first demonstration.
        evaluate_every: rounds between evaluations; the last round always is.
        driving_style: of scripted teachers.
        tries: at the first demonstration before the teacher is given up.
    """

    rounds: int = 12
    evaluate_every: int = 2
    driving_style: DrivingStyle = "softened"
    tries: int = 10
    policy: PolicyConfig = field(default_factory=PolicyConfig)
    training: PolicyTrainingConfig = field(default_factory=PolicyTrainingConfig)

    def __post_init__(self) -> None:
        for name in ("rounds", "evaluate_every", "tries"):
            if getattr(self, name) < 1:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it must be at least 1.")


@dataclass(frozen=True, kw_only=True, eq=False)
class Judging:
    """Where policies are judged: a few starts on the way, and more at the end."""

    on_the_way: Sequence[Start]
    at_the_end: Sequence[Start]


@dataclass(frozen=True, kw_only=True, eq=False)
class TeachingSpec:
    """Who teaches which learner.

    Attributes:
        teacher: their name.
        seed: of starts, noise, initial weights and batches, which no agent changes.
    """

    teacher: str
    agent: Agent
    config: TeachingConfig
    judging: Judging
    seed: int


@dataclass
class _Learnt:
    """What a rest has brought so far; ``result`` is None until the learner has learnt."""

    learner: PolicyLearner
    result: RoundResult | None = None
    drives: Sequence[DriveResult] = ()


class TeachingLoop:
    """One teacher teaches one learner; goes on after whatever round was kept last.

    A drive that was finished before a crash, and not learnt from yet, is learnt from first.

    Attributes:
        learner: as the last round that was kept left it.
    """

    def __init__(
        self, spec: TeachingSpec, env: TaskEnv, log: TeachingLog, interface: TeacherInterface
    ) -> None:
        self._spec, self._env = spec, env
        self._log, self._interface = log, interface
        self.learner = new_learner(spec)
        self._collected: list[TrainingRows] = []

    def run(self) -> bool:
        """Teach to the end; False if it was stopped, and then it goes on from there.

        Raises:
            BallNeverReached: the first demonstration never got there.
            NothingShown: it holds no label.
            RoundDiverged: a loss was not finite.
            SteerlabError: interface or log fail.
        """
        done = len(self._log.rounds())
        if done and not self._interface.wait(REMEMBERING, self._remember):
            return False
        for number in range(done, self._spec.config.rounds + 1):
            if not self._round(number):
                return False
        return self._interface.wait(TRYING, self._evaluate_rest)

    def _remember(self, progress: ShareProgress) -> None:
        """Bring a new learner to where the last round that was kept left it.

        It is trained anew on the rows of each round, which also brings back what policies do not
        hold (the state of its randomness, what it doubts by); its weights are then the kept ones,
        so that another machine's rounding does not make another robot.
        """
        kept = self._log.rounds()
        for done, one in enumerate(kept):
            progress(done / len(kept))
            rows = one.rows()
            if rows is not None:
                self._collected.append(rows)
                self.learner.train(self._collected)
        self.learner.load(kept[-1].networks())

    def _round(self, number: int) -> bool:
        """Until the round is kept; False to stop."""
        drive = self._left_over(number)
        while True:
            drive = drive or self._drive(number)
            if drive is None:
                return False
            learnt = _Learnt(deepcopy(self.learner))  # a redo, or a failure, leaves what was
            try:
                how = self._rest(number, drive, learnt)
            except TrainingDiverged as error:
                if drive.seen is not None:
                    raise RoundDiverged(number, str(error)) from error
                drive = None  # of an earlier run, where it was so before: drive anew
                continue
            if learnt.result is not None and how is not AfterRest.REDO:
                self._keep(learnt.result, learnt)
            if how is AfterRest.STOP:
                return False
            if learnt.result is not None and how is AfterRest.GO_ON:
                return True
            drive = None

    def _left_over(self, number: int) -> FinishedDrive | None:
        """A drive of this round that was finished, and not learnt from yet."""
        found = self._log.left_over(number)
        if found is None or (number == 0 and found.outcome is not Outcome.BALL_REACHED):
            return None
        return found

    def _drive(self, number: int) -> FinishedDrive | None:
        """One drive; None to stop."""
        spec = self._spec
        if number == 0:
            return demonstrate(
                self._env,
                self._log,
                self._interface,
                teacher=spec.teacher,
                seed=spec.seed,
                tries=spec.config.tries,
            )
        drive = RoundDrive(
            env=self._env,
            context=self._log.next_drive(number),
            gate=spec.agent.gate,
            learner=self.learner,
            seed=spec.seed,
        )
        return self._interface.drive(drive)

    def _rest(self, number: int, drive: FinishedDrive, learnt: _Learnt) -> AfterRest:
        def learn(progress: ShareProgress) -> None:
            self._learn(number, drive, learnt, progress)

        def meanwhile(progress: ShareProgress) -> None:
            if self._is_evaluated(number):
                learnt.drives = self._evaluate(number, learnt.learner, progress)
            self._evaluate_rest(progress)

        return self._interface.rest(number, drive.outcome, learn, meanwhile)

    def _learn(
        self, number: int, drive: FinishedDrive, learnt: _Learnt, progress: ShareProgress
    ) -> None:
        """Make targets of the drive and train on them; a drive without any changes nothing."""
        progress(0.0)
        began_s = perf_counter()
        episode = self._log.episode(drive)
        targets = self._targets(number, episode)
        rows = targets.rows(episode.seen)
        loss = None
        if rows is not None:
            loss = learnt.learner.train([*self._collected, rows], progress)
        elif number == 0:
            raise NothingShown(
                f"The first drive of {self._spec.teacher} holds no label that can be learnt from; "
                "look at the device, and drive again."
            )
        label_mae, given_mae = label_errors(episode, targets)
        asked = int(targets.asked.sum())
        learnt.result = RoundResult(
            round_number=number,
            drive=drive,
            episode=episode,
            targets=targets,
            rows=rows,
            label_mae=label_mae,
            given_mae=given_mae,
            labels_asked=asked,
            teacher_seconds=asked * HELD_STEPS / episode.rollout.control_hz,
            switches=episode.switches,
            loss=loss,
            training_s=perf_counter() - began_s,
        )
        progress(1.0)

    def _targets(self, number: int, episode: Episode) -> Targets:
        """By the agent's rule; what is shown first is taken as it was driven, never mapped."""
        agent = self._spec.agent
        if number > 0:
            return agent.rule.target(episode, self.learner)
        rule = OracleLabelRule() if agent.demonstration_is_oracle else WhereTeacherDrives()
        return rule.target(episode, self.learner)

    def _keep(self, result: RoundResult, learnt: _Learnt) -> None:
        self._log.keep(replace(result, drives=learnt.drives), learnt.learner.networks)
        self.learner = learnt.learner
        if result.rows is not None:
            self._collected.append(result.rows)

    def _is_evaluated(self, number: int) -> bool:
        config = self._spec.config
        return number == config.rounds or number % config.evaluate_every == 0

    def _evaluate(
        self, number: int, learner: PolicyLearner, progress: ShareProgress
    ) -> list[DriveResult]:
        judging, last = self._spec.judging, number == self._spec.config.rounds
        starts = judging.at_the_end if last else judging.on_the_way
        return evaluate(self._env, learner, starts, progress)

    def _evaluate_rest(self, progress: ShareProgress) -> None:
        """Let the policies of all rounds drive that are kept and have not driven yet."""
        kept = self._log.rounds()
        waiting = [one for one in kept if not one.evaluated and self._is_evaluated(one.number)]
        for done, one in enumerate(waiting):
            fresh = new_learner(self._spec)
            fresh.load(one.networks())

            def on_share(share: float, done: int = done) -> None:
                progress((done + share) / len(waiting))

            self._log.keep_drives(one.number, self._evaluate(one.number, fresh, on_share))


def demonstrate(
    env: TaskEnv, log: DriveLog, interface: TeacherInterface, *, teacher: str, seed: int, tries: int
) -> FinishedDrive | None:
    """The first demonstration, redone with other noise until it reaches the ball.

    Returns:
        the drive that did; None to stop.

    Raises:
        BallNeverReached: none of ``tries`` drives does.
    """
    failed: Outcome | None = None
    for left in range(tries, 0, -1):
        drive = RoundDrive(
            env=env,
            context=log.next_drive(0),
            gate=TeacherDrives(),
            learner=None,
            seed=seed,
            failed=failed,
            tries_left=left,
        )
        found = interface.drive(drive)
        if found is None or found.outcome is Outcome.BALL_REACHED:
            return found
        failed = found.outcome
    raise BallNeverReached(
        f"{teacher} did not reach the ball of task {env.task.name!r} in {tries} first drives "
        f"(noise {env.task.noise:g}), so there is nothing to learn from."
    )


def new_learner(spec: TeachingSpec) -> PolicyLearner:
    """Nothing learnt yet; the weights depend on the seed alone."""
    return PolicyLearner(
        spec.seed,
        members=spec.agent.ensemble,
        doubts=spec.agent.doubts,
        policy=spec.config.policy,
        training=spec.config.training,
    )
