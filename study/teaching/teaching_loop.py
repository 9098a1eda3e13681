"""The course of one condition: the first demonstration, then rounds of drive, rest and learning."""

from copy import deepcopy
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from steerlab.learning.agents.common import WhereTeacherDrives
from steerlab.learning.agents.contract import Targets
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.oracle import OracleLabelRule
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import BallNeverReached
from steerlab.learning.policy_training import TrainingDiverged, TrainingRows
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS
from steerlab.study.store.teaching import StoredTargets, TaughtRound, Trial
from steerlab.study.teaching.episodes import episode_of, errors, rerender_observations
from steerlab.study.teaching.errors import TeachingError
from steerlab.study.teaching.learning import new_learner, restore_learner
from steerlab.study.teaching.round_drive import RoundDrive, make_lesson
from steerlab.study.teaching.spec import TeachingSpec
from steerlab.study.teaching.teacher_interface import Drove, TeacherInterface, Tick
from steerlab.study.teaching.teaching_log import TeachingLog
from steerlab.study.teaching.trials import evaluate_policy, try_all
from steerlab.teleop.screen.contract import Act

REMEMBERING = "The robot remembers what it was taught"
TRYING = "That is all. The robot tries out what it has learnt, and the window closes by itself"


@dataclass
class _Learnt:
    """What a rest has brought so far."""

    learner: PolicyLearner
    done: bool = False
    targets: Targets | None = None
    rows: TrainingRows | None = None
    taught: TaughtRound | None = None
    trials: list[Trial] = field(default_factory=list)


class TeachingLoop:
    """One participant teaches one condition; goes on after whatever round was kept last.

    A drive that was finished before a crash, and not learnt from yet, is learnt from first.
    """

    def __init__(
        self, subject: TeachingSpec, stage: TaskEnv, register: TeachingLog, host: TeacherInterface
    ) -> None:
        self._subject, self._stage = subject, stage
        self._register, self._host = register, host
        self._learner = new_learner(subject.agent, subject.plan, subject.seed)
        self._collected: list[TrainingRows] = []

    def run(self) -> bool:
        """Teach to the end; False if it was stopped, and then it goes on from there.

        Raises:
            BallNeverReached: the first demonstration never got there.
            TeachingError: a policy cannot be kept or read, or what was shown cannot be learnt.
            SteerlabError: device, display or store fail.
        """
        done = len(self._register.taught())
        if done and not self._host.wait(REMEMBERING, self._learn_again):
            return False
        for number in range(done, self._subject.rounds + 1):
            if not self._round(number):
                return False
        return self._host.wait(TRYING, self._try_all)

    def _learn_again(self, tick: Tick) -> None:
        self._collected = restore_learner(self._learner, self._register, self._stage, tick)

    def _round(self, number: int) -> bool:
        """Until the round is kept; False to stop."""
        drove = self._left_over(number)
        while True:
            fresh = drove is None
            drove = drove or self._drive(number)
            if drove is None:
                return False
            learnt = _Learnt(deepcopy(self._learner))  # a redo, or a failure, leaves what was
            try:
                act = self._rest(number, drove, learnt)
            except TrainingDiverged as error:
                if fresh:
                    raise self._diverged(number, error) from error
                drove = None  # it was so before: another drive may be learnt from
                continue
            if learnt.done and act is not Act.REDO:
                self._keep(number, learnt)
            if act is Act.STOP:
                return False
            if learnt.done and act is Act.CONFIRM:
                return True
            drove = None

    def _left_over(self, number: int) -> Drove | None:
        """A drive of this round that was finished, and not learnt from before a crash."""
        name = self._name(number)
        found = self._register.left_over(name)
        if found is None or (number == 0 and found[1] is not Outcome.BALL_REACHED):
            return None
        return Drove(rollout=name, attempt=found[0].attempt, outcome=found[1], seen=None)

    def _drive(self, number: int) -> Drove | None:
        """One drive; the first is done again until it reaches the ball. None to stop."""
        plan = self._subject.plan
        for left in range(plan.tries - 1, -1, -1):
            drove = self._host.drive(self._lesson(number))
            if drove is None or number > 0 or drove.outcome is Outcome.BALL_REACHED:
                return drove
            if left and not self._host.try_again(drove.outcome, left):
                return None
        raise BallNeverReached(
            f"{self._register.participant} did not reach the ball of task {plan.task!r} in "
            f"{plan.tries} first drives, so there is nothing to learn from yet. All of them are "
            f"kept. Run the phase again for {plan.tries} more, after some practice; for "
            f"participants yet to come a new version of the protocol may have less teaching.noise."
        )

    def _lesson(self, number: int) -> RoundDrive:
        subject, name = self._subject, self._name(number)
        return make_lesson(
            self._stage,
            subject.taught_by,
            subject.agent,
            self._learner if number else None,
            name=name,
            number=number,
            attempt=self._register.attempts(name),
            seed=subject.seed,
        )

    def _name(self, number: int) -> str:
        """Of the drive in the store."""
        subject = self._subject
        return f"{self._register.phase}-{subject.condition}-{subject.plan.task}-r{number:02d}"

    def _rest(self, number: int, drove: Drove, learnt: _Learnt) -> Act:
        def meanwhile(tick: Tick) -> None:
            learnt.trials = evaluate_policy(self._stage, self._subject, learnt.learner, tick)
            self._try_all(tick)

        return self._host.rest(
            number, drove.outcome, lambda tick: self._learn(number, drove, learnt, tick), meanwhile
        )

    def _learn(self, number: int, drove: Drove, learnt: _Learnt, tick: Tick) -> None:
        """Make targets of the drive and train on them; a drive without any changes nothing."""
        tick(0.0)
        subject, began_s = self._subject, perf_counter()
        steps = self._register.steps(drove.rollout, drove.attempt)
        seen = drove.seen or rerender_observations(self._stage, steps)
        episode = episode_of(steps, seen, drove.outcome, self._stage, number)
        rule = subject.agent.rule
        if number == 0:  # what was shown is taken as it is, but for the oracle
            oracle = subject.agent.demonstration_is_oracle
            rule = OracleLabelRule() if oracle else WhereTeacherDrives()
        targets = rule.target(episode, self._learner)
        rows = targets.rows(episode.seen)
        loss = None
        if rows is not None:
            loss = learnt.learner.train([*self._collected, rows], tick)
        elif number == 0:
            raise TeachingError(
                f"The first drive of {self._register.participant} holds no label that can be "
                "learnt from; look at the device, and drive again."
            )
        label_mae, given_mae = errors(episode, targets)
        asked = int(targets.asked.sum())
        learnt.targets, learnt.rows = targets, rows
        learnt.taught = TaughtRound(
            participant=self._register.participant,
            phase=self._register.phase,
            occasion=self._register.occasion,
            condition=subject.condition,
            round=number,
            rollout=drove.rollout,
            attempt=drove.attempt,
            outcome=drove.outcome,
            labels_asked=asked,
            label_mae=label_mae,
            given_mae=given_mae,
            teacher_s=asked * HELD_STEPS / episode.rollout.control_hz,
            switches=episode.switches,
            loss=loss,
            training_s=perf_counter() - began_s,
            policies={},
            mapper_sha256=subject.mapper_sha256 if number else None,
        )
        learnt.done = True
        tick(1.0)

    def _keep(self, number: int, learnt: _Learnt) -> None:
        """Policies first, then all that is known of the round at once: now it is done."""
        assert learnt.taught is not None
        assert learnt.targets is not None
        targets = learnt.targets
        policies = self._register.save(number, learnt.learner.networks)
        rows = HELD_STEPS * np.arange(len(targets.target))
        stored = StoredTargets(rows, targets.target, targets.weight, targets.asked)
        self._register.keep(replace(learnt.taught, policies=policies), stored, learnt.trials)
        self._learner = learnt.learner
        if learnt.rows is not None:
            self._collected.append(learnt.rows)

    def _try_all(self, tick: Tick) -> None:
        try_all(self._stage, self._subject, self._register, tick)

    def _diverged(self, number: int, error: TrainingDiverged) -> TeachingError:
        return TeachingError(
            f"Round {number} of {self._register.participant} cannot be learnt from: {error} The "
            f"drive is kept and the robot is as it was before; run the phase again to drive this "
            f"round anew. If that does not help, look at the labels, and at teaching.rate."
        )
