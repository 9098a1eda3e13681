"""Protocols and records of interactive learners: learner, gate, label rule, episode."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.policy import Observations
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.progress import ShareProgress, no_progress
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome, Rollout


class Watching(StrEnum):
    """What a gate needs of the teacher while the learner drives."""

    NOTHING = "nothing"
    REACTING = "reacting"  # the teacher follows the drive, ready to take the wheel


class Learner(Protocol):
    """A policy that drives, states its doubt, and learns from rows."""

    def act(self, seen: Observations) -> FloatArray:
        """Wheel positions (rows,) within ±``WHEEL_LIMIT``."""
        ...

    def doubt(self, seen: Observations) -> FloatArray:
        """How unsure it is of each row, (rows,); 1 is where it starts to be unsure."""
        ...

    def train(
        self, episodes: Sequence[TrainingRows], progress: ShareProgress = no_progress
    ) -> float:
        """Learn from everything collected so far, one entry an episode; the last mean loss.

        Args:
            progress: told the share that is done; what it raises ends the training.
        """
        ...


@dataclass(slots=True)
class GateInput:
    """What a gate may look at before a decision; ``NaN`` where it did not ask for it.

    Attributes:
        held: who drove until now.
        learner_wheel: what the learner would do; NaN without a learner.
        teacher_wheel: what the teacher would do; NaN unless the gate has the teacher react.
        oracle_wheel: ground truth; only for scripted people's sense of danger, never for a learner.
        doubt: the learner's; see ``Learner.doubt``.
    """

    decision: int
    held: Driver
    learner_wheel: float
    teacher_wheel: float
    oracle_wheel: float
    doubt: float


class Gate(Protocol):
    """Decides who drives."""

    watching: Watching
    needs_doubt: bool

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Prepare for a new drive."""
        ...

    def who_drives(self, moment: GateInput) -> Driver:
        """Who drives for the coming decision."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Episode:
    """One finished drive: columns of control steps, and rows of decisions.

    Attributes:
        rollout: every control step; ``robot_wheel`` is what the learner asked for, held between
            decisions, or what was driven where there was no learner.
        feedback: (steps,) the teacher's labels for the whole drive, given afterwards by someone who
            watched it; the label rule decides which of them count and were asked for.
        live: (steps,) the teacher's wheel while driving; NaN elsewhere.
        teacher_drives: (decisions,) who held the wheel.
        seen: the observations at each decision.
        rows: (decisions,) the control step each decision was made at.
        learner_wheel: (decisions,) what the learner asked for; NaN without a learner.
    """

    rollout: Rollout
    feedback: FloatArray
    live: FloatArray
    teacher_drives: BoolArray
    seen: Observations
    rows: np.ndarray
    learner_wheel: FloatArray
    round_number: int
    person: str

    @property
    def outcome(self) -> Outcome:
        """How the drive ended."""
        return self.rollout.outcome

    @property
    def switches(self) -> int:
        """How often the wheel changed hands."""
        return int((self.teacher_drives[1:] != self.teacher_drives[:-1]).sum())

    @property
    def truth(self) -> FloatArray:
        """(decisions,) oracle labels; NaN where there is none."""
        return self.rollout.oracle_label[self.rows]


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """What a rule makes of an episode, (decisions,) each.

    Attributes:
        target: wheel positions; NaN where ``weight`` is 0.
        weight: of each row; 0 leaves it out.
        asked: whether the teacher had to steer for this row, labelling or driving.
    """

    target: FloatArray
    weight: FloatArray
    asked: BoolArray

    def __post_init__(self) -> None:
        if not self.target.shape == self.weight.shape == self.asked.shape:
            raise InvalidLabels(
                f"target {self.target.shape}, weight {self.weight.shape} and asked "
                f"{self.asked.shape} are not of one episode."
            )
        if not np.isfinite(self.target[self.weight > 0.0]).all():
            raise InvalidLabels("A weighted target is not finite; give it weight 0.")

    def rows(self, seen: Observations) -> TrainingRows | None:
        """The rows that train; None where the gate let no label through."""
        kept = self.weight > 0.0
        if not kept.any():
            return None
        return TrainingRows(seen.take(kept), self.target[kept], self.weight[kept])


class LabelRule(Protocol):
    """Turns an episode into what the learner imitates."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Targets of one episode.

        Args:
            learner: as it drove, before it learns from this.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Agent:
    """One condition: who drives, and which labels the learner imitates.

    Attributes:
        ensemble: policies in the learner.
        doubts: which doubt the learner has, see ``PolicyLearner``; ``none`` for learners whose gate
            and rule never ask.
        demonstration_is_oracle: the first demonstration's labels too are ground truth.
    """

    name: str
    gate: Gate
    rule: LabelRule
    ensemble: int = 1
    doubts: str = "none"
    demonstration_is_oracle: bool = False
