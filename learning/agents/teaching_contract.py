"""What the teaching loop asks of the two around it: whoever teaches, and whatever keeps it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from steerlab.learning.agents.contract import Episode, Targets
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.evaluation import DriveResult
from steerlab.learning.policy import Observations, PolicyNetwork
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.live_teacher import DriveContext
from steerlab.sim.progress import ShareProgress
from steerlab.sim.rollout import Outcome

Work = Callable[[ShareProgress], None]
"""Something that takes time and tells how far it is; what telling it raises ends the work."""


class AfterRest(StrEnum):
    """How the teacher wants to go on."""

    GO_ON = "go on"
    REDO = "redo"  # drive this round again, and forget what was learnt from it
    STOP = "stop"


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedDrive:
    """A drive that came to its end, kept wherever drives are kept.

    Attributes:
        number: of the round.
        seen: what the robot saw at each decision; None if it was driven before this run.
    """

    name: str
    number: int
    attempt: int
    outcome: Outcome
    seen: Observations | None


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundResult:
    """What a round asked of the teacher and left; round 0 is the first demonstration.

    Attributes:
        rows: what was collected; None where the gate let no label through.
        label_mae: mean |target - truth| over the rows asked for, in wheel units; None where there
            is none.
        given_mae: as ``label_mae``, of the labels as they were given.
        teacher_seconds: with the wheel in hand, labelling or driving.
        loss: last mean training loss; None without rows: the policy stayed as it was.
        training_s: seconds it took to make targets and train.
        drives: evaluation drives after training; empty where this round was not evaluated.
    """

    round_number: int
    drive: FinishedDrive
    episode: Episode
    targets: Targets
    rows: TrainingRows | None
    label_mae: float | None
    given_mae: float | None
    labels_asked: int
    teacher_seconds: float
    switches: int
    loss: float | None
    training_s: float
    drives: Sequence[DriveResult] = ()

    @property
    def outcome(self) -> Outcome:
        """How its drive ended."""
        return self.drive.outcome


@dataclass(frozen=True, kw_only=True, eq=False)
class KeptRound:
    """A round that is done; what is slow to read is read when it is asked for.

    Attributes:
        evaluated: its policies have driven from the starts.
        rows: what was collected, if anything.
        networks: the policies that it left.
    """

    number: int
    evaluated: bool
    rows: Callable[[], TrainingRows | None]
    networks: Callable[[], Sequence[PolicyNetwork]]


class TeacherInterface(Protocol):
    """Lets somebody drive and rest: a script at once, a person in their own time."""

    def drive(self, drive: RoundDrive) -> FinishedDrive | None:
        """Until an attempt is finished and kept; None to stop."""
        ...

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> AfterRest:
        """Let the teacher rest while the robot learns, and ask how to go on.

        Args:
            learn: must be done before it goes on.
            meanwhile: what else there is to do; dropped when the teacher goes on.

        Returns:
            how to go on; ``REDO`` and ``STOP`` also before ``learn`` is done.
        """
        ...

    def wait(self, what: str, work: Work) -> bool:
        """Do something that the teacher waits for; False to stop."""
        ...


class DriveLog(Protocol):
    """What was driven, which the interface adds to."""

    def next_drive(self, number: int) -> DriveContext:
        """The name and the attempt of the next drive of round ``number``."""
        ...

    def left_over(self, number: int) -> FinishedDrive | None:
        """The last drive of a round, if it was finished and the round was not kept."""
        ...

    def episode(self, drive: FinishedDrive) -> Episode:
        """What is learnt from."""
        ...


class RoundLog(Protocol):
    """What was learnt; whatever is written is kept when the method returns."""

    def rounds(self) -> Sequence[KeptRound]:
        """The rounds that are done, in order."""
        ...

    def keep(self, result: RoundResult, networks: Sequence[PolicyNetwork]) -> None:
        """Keep a round and its policies: it is done when this returns."""
        ...

    def keep_drives(self, number: int, drives: Sequence[DriveResult]) -> None:
        """Keep how the policies of a round drove, where ``keep`` was not given it."""
        ...


class TeachingLog(DriveLog, RoundLog, Protocol):
    """Both: in memory, or in a study's database."""
