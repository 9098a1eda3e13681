"""Who gives labels: the protocol that scripted teachers and, later, a real wheel share."""

from typing import Protocol

from steerlab.sim.rollout import Rollout


class Teacher(Protocol):
    """Watches a rollout and says, step by step, where the wheel should have been."""

    name: str  # the participant's pseudonym

    def begin(self, rollout: Rollout, *, order: int, attempt: int) -> None:
        """Get ready to label ``rollout``, the ``order``-th of this teacher's session."""
        ...

    def label(self, step: int) -> float | None:
        """The label for ``step`` in [-2.5, 2.5]; None when the device gave none."""
        ...
