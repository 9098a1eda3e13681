"""Gates: who drives at each decision of an interactive learner. ``catalogue.py`` combines them."""

import numpy as np

from steerlab.learning.agents.contract import GateInput, Watching
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import Driver

BETA = 0.5
TAKE_WHEEL = 0.9  # wheel units of smoothed error; a hand on the wheel notices about a third of lock
GIVE_BACK = 0.35
SMOOTHING = 0.4  # weight of the newest decision, 0.1 s
LEAST_HELD = 8  # decisions; nobody hands back within a moment of taking over
DISCREPANCY_WHEEL = 1.0


class LearnerDrives:
    """The learner drives, always."""

    watching = Watching.NOTHING
    needs_doubt = False

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Keeps no state."""

    def who_drives(self, moment: GateInput) -> Driver:
        """Always the robot."""
        return Driver.ROBOT


class TeacherDrives:
    """The teacher drives, always."""

    watching = Watching.REACTING
    needs_doubt = False

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Keeps no state."""

    def who_drives(self, moment: GateInput) -> Driver:
        """Always the teacher."""
        return Driver.TEACHER


class BetaMixture:
    """DAgger's mixture: the teacher drives with probability ``beta ** round`` at each decision."""

    watching = Watching.REACTING
    needs_doubt = False

    def __init__(self, beta: float = BETA) -> None:
        if not 0.0 <= beta <= 1.0:
            raise InvalidConfig(f"beta is {beta}; it is a probability, from 0 to 1.")
        self._beta = beta
        self._share = 0.0
        self._rng = np.random.default_rng(0)

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Set the probability of the round, which counts from 1."""
        self._share, self._rng = self._beta**round_number, rng

    def who_drives(self, moment: GateInput) -> Driver:
        """Drawn anew for each decision, as in the paper's algorithm."""
        return Driver.TEACHER if self._rng.random() < self._share else Driver.ROBOT


class RiskGate:
    """A scripted person's sense of danger: how far the learner's wheel is from the right one.

    They take over when the smoothed error is large, and hand back when it has been small.
    """

    watching = Watching.REACTING
    needs_doubt = False

    def __init__(self, take: float = TAKE_WHEEL, give_back: float = GIVE_BACK) -> None:
        if not 0.0 <= give_back <= take:
            raise InvalidConfig(
                f"A gate that takes at {take} and gives back at {give_back} has no hysteresis; "
                "give 0 <= give_back <= take."
            )
        self._take, self._give_back = take, give_back
        self._risk, self._since = 0.0, 0

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Start without a sense of danger."""
        self._risk, self._since = 0.0, 0

    def who_drives(self, moment: GateInput) -> Driver:
        """With hysteresis, and for at least ``LEAST_HELD`` decisions."""
        error = abs(moment.learner_wheel - moment.oracle_wheel)
        if np.isfinite(error):
            self._risk += SMOOTHING * (error - self._risk)
        self._since += 1
        if moment.held is Driver.ROBOT:
            if self._risk <= self._take:
                return Driver.ROBOT
            self._since = 0
            return Driver.TEACHER
        if self._since >= LEAST_HELD and self._risk < self._give_back:
            return Driver.ROBOT
        return Driver.TEACHER


class DoubtGate:
    """The teacher drives where the learner's doubt is above 1; nothing of the teacher is read."""

    watching = Watching.REACTING
    needs_doubt = True

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Keeps no state."""

    def who_drives(self, moment: GateInput) -> Driver:
        """Doubt above 1 asks for the teacher."""
        return Driver.TEACHER if moment.doubt > 1.0 else Driver.ROBOT


class EnsembleGate:
    """The teacher drives where doubt is above 1 or the two wheels are far apart."""

    watching = Watching.REACTING
    needs_doubt = True

    def __init__(self, discrepancy: float = DISCREPANCY_WHEEL) -> None:
        self._discrepancy = discrepancy

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Keeps no state."""

    def who_drives(self, moment: GateInput) -> Driver:
        """The paper's decision rule: both must hold for the learner to drive."""
        apart = abs(moment.learner_wheel - moment.teacher_wheel)
        safe = moment.doubt <= 1.0 and apart <= self._discrepancy
        return Driver.ROBOT if safe else Driver.TEACHER
