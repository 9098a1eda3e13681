"""Where robots are taught, a window or nowhere: what the course asks of either."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from steerlab.learning.policy import Observations
from steerlab.sim.rollout import Outcome
from steerlab.study.teaching.round_drive import RoundDrive
from steerlab.teleop.screen.contract import Act

Tick = Callable[[float], None]
"""Takes the share that is done; may raise ``Pressed``, which stops the work."""
Work = Callable[[Tick], None]


class Pressed(Exception):
    """The person asked for something while work goes on; no error."""

    def __init__(self, act: Act) -> None:
        super().__init__(act.value)
        self.act = act


@dataclass(frozen=True, kw_only=True, eq=False)
class Drove:
    """A finished attempt, on the disk.

    Attributes:
        seen: what the robot saw; None if it was driven before this run.
    """

    rollout: str
    attempt: int
    outcome: Outcome
    seen: Observations | None


class TeacherInterface(Protocol):
    """Lets somebody drive and rest."""

    def drive(self, lesson: RoundDrive) -> Drove | None:
        """One finished attempt at a lesson; None to stop."""
        ...

    def try_again(self, outcome: Outcome, left: int) -> bool:
        """Say that the first demonstration did not reach the ball; False to stop."""
        ...

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> Act:
        """Let the person rest while the robot learns, and ask how to go on.

        Args:
            learn: must be done before it goes on.
            meanwhile: what else there is to do; dropped when the person goes on.

        Returns:
            ``CONFIRM``, ``REDO`` or ``STOP``; the latter two also before ``learn`` is done.
        """
        ...

    def wait(self, what: str, work: Work) -> bool:
        """Do something that the person waits for; False to stop."""
        ...
