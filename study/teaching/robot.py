"""The robot while it is taught: a learner that decides now and then, and its wheel held between."""

from time import perf_counter_ns

from steerlab.learning.agents.contract import Learner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, stack
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.tasks import HELD_STEPS

NOTHING_LEARNT = 0.0  # the wheel of a robot that nobody has shown anything yet


class Robot:
    """A ``Policy`` for ``LiveDrive``: looks and decides at every ``HELD_STEPS``-th step.

    Asking it twice about a step changes nothing, so whoever labels may ask as well.

    Args:
        stage: the car that it drives.
        learner: None before the first demonstration: it then only watches.
        doubts: also ask the learner how unsure it is.

    Attributes:
        doubt: at the last decision; NaN unless asked for.
        decision_ns: how long each decision took, picture included.
    """

    def __init__(self, stage: TaskEnv, learner: Learner | None, *, doubts: bool = False) -> None:
        self._stage, self._learner, self._doubts = stage, learner, doubts
        self.decision_ns: list[int] = []
        self.begin()

    def begin(self) -> None:
        """A new attempt: nothing has been seen."""
        self._seen: list[Observations] = []
        self._wheel = NOTHING_LEARNT
        self.doubt = float("nan")

    def __call__(self, state: DrivingState) -> float:
        """The wheel for this state, which must be the stage's."""
        if state.step // HELD_STEPS == len(self._seen):
            began_ns = perf_counter_ns()
            self._decide(self._stage.look())
            self.decision_ns.append(perf_counter_ns() - began_ns)
        return self._wheel

    @property
    def seen(self) -> Observations:
        """What it saw at each decision of this attempt."""
        return stack(self._seen)

    def _decide(self, seen: Observations) -> None:
        self._seen.append(seen)
        if self._learner is not None:
            self._wheel = float(self._learner.act(seen)[0])
            if self._doubts:
                self.doubt = float(self._learner.doubt(seen)[0])
