"""A drive of a round: the learner at the wheel, and the gate that says who drives.

Both decide at every ``HELD_STEPS``-th control step, and the decision is held in between. The same
code serves simulated drives (``offline.py``) and real-time ones in a window.
"""

from dataclasses import dataclass
from functools import cached_property
from time import perf_counter_ns

import numpy as np

from steerlab.learning.agents.contract import Gate, GateInput, Learner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, stack
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.live_teacher import DriveContext
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS, Start, draw_task_start, redraw_noise

NAN = float("nan")
NOTHING_LEARNT = 0.0  # the wheel of a robot that has not learned anything yet


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundDrive:
    """A drive to be driven.

    Attributes:
        learner: None in the first demonstration, which the teacher drives.
        seed: of the start, the noise and the gate's draws.
        failed: how the try before this one ended; None unless the first demonstration is redone.
        tries_left: at the first demonstration, this one included.
    """

    env: TaskEnv
    context: DriveContext
    gate: Gate
    learner: Learner | None
    seed: int
    failed: Outcome | None = None
    tries_left: int = 1

    @property
    def number(self) -> int:
        """The round; 0 is the first demonstration."""
        return self.context.round_number

    @cached_property
    def start(self) -> Start:
        """Where it begins, and the noise that is added to the executed wheel.

        They depend on seed and round, not on the condition; the first demonstration meets other
        noise at each attempt.
        """
        start = draw_task_start(self.env.task, "teach", self.seed, self.number)
        if self.number == 0:
            return redraw_noise(self.env.task, start, self.seed, self.context.attempt)
        return start

    def gate_rng(self) -> np.random.Generator:
        """The gate's random generator; the same in every attempt."""
        return np.random.default_rng([self.seed, self.number, 0x6A7E])


class Robot:
    """The learner at the wheel: looks and decides at every ``HELD_STEPS``-th step.

    Asking it twice about a step changes nothing, so a labeller may ask as well.

    Args:
        env: the car that it drives.
        learner: None before the first demonstration: it then only watches.
        doubts: also ask the learner how unsure it is.

    Attributes:
        doubt: at the last decision; NaN unless asked for.
        decision_ns: how long each decision took, picture included.
    """

    def __init__(self, env: TaskEnv, learner: Learner | None, *, doubts: bool = False) -> None:
        self._env, self._learner, self._doubts = env, learner, doubts
        self.decision_ns: list[int] = []
        self.begin()

    def begin(self) -> None:
        """Start a new attempt, forgetting what was seen."""
        self._seen: list[Observations] = []
        self._wheel = NOTHING_LEARNT
        self.doubt = NAN

    def __call__(self, state: DrivingState) -> float:
        """The wheel for this state, which must be the environment's."""
        if state.step // HELD_STEPS == len(self._seen):
            began_ns = perf_counter_ns()
            self._decide(self._env.look())
            self.decision_ns.append(perf_counter_ns() - began_ns)
        return self._wheel

    @property
    def seen(self) -> Observations:
        """The observations at each decision of this attempt."""
        return stack(self._seen)

    def _decide(self, seen: Observations) -> None:
        self._seen.append(seen)
        if self._learner is not None:
            self._wheel = float(self._learner.act(seen)[0])
            if self._doubts:
                self.doubt = float(self._learner.doubt(seen)[0])


class HeldGate:
    """A gate that is asked at decisions only; in between, the same driver goes on.

    Args:
        least_given: decisions for which the teacher keeps the wheel at least.
    """

    def __init__(self, gate: Gate, *, least_given: int = 0) -> None:
        self._gate, self._least_given = gate, least_given
        self.held, self._since = Driver.ROBOT, 0

    def begin(self, number: int, rng: np.random.Generator, held: Driver = Driver.ROBOT) -> None:
        """An attempt at round ``number`` begins, with the wheel in the hands of ``held``."""
        self._gate.begin(number, rng)
        self.held, self._since = held, 0

    def who_drives(
        self, step: int, robot_wheel: float, teacher_wheel: float, truth: float, doubt: float
    ) -> Driver:
        """Who drives control step ``step``; see ``GateInput`` for what the gate may look at."""
        decision, rest = divmod(step, HELD_STEPS)
        if rest == 0:
            moment = GateInput(decision, self.held, robot_wheel, teacher_wheel, truth, doubt)
            named = self._gate.who_drives(moment)
            self._since += 1
            keeps = self.held is Driver.TEACHER and self._since < self._least_given
            if named is not self.held and not keeps:
                self.held, self._since = named, 0
        return self.held
