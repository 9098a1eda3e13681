"""What ends something is asked for once: it counts when it is pressed again."""

from collections.abc import Callable

from steerlab.sim.language import said
from steerlab.teleop.screen.contract import Act

AGAIN_WITHIN_NS = 3_000_000_000
QUESTIONS = {
    Act.STOP: "Press it once more to stop",
    Act.REDO: "Press it once more to start this again",
}


class Confirm:
    """Passes on what was pressed, but ``STOP`` and ``REDO`` only when pressed twice in 3 s."""

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._asked: tuple[Act, int] | None = None

    def press(self, act: Act) -> Act | None:
        """``act`` if it counts; None if it is asked for again."""
        if act not in QUESTIONS:
            self._asked = None
            return act
        if self._waiting() is act:
            self._asked = None
            return act
        self._asked = act, self._now_ns()
        return None

    @property
    def question(self) -> str | None:
        """What the person must be told meanwhile."""
        act = self._waiting()
        return None if act is None else said(QUESTIONS[act])

    def _waiting(self) -> Act | None:
        if self._asked is None or self._now_ns() - self._asked[1] > AGAIN_WITHIN_NS:
            return None
        return self._asked[0]
