"""SafeDAgger: a second model predicts whether the learner strays from the teacher, and decides.

Zhang & Cho, "Query-efficient imitation learning for end-to-end autonomous driving", AAAI 2017. Where
the safety model says unsafe, the teacher drives and the step is learned. The safety model learns
from the errors that the policy made on the teacher's rows *before* it learned them. Departures: a
logistic regression on the policy's own features stands for the paper's safety network, refitted
each round (``learner.py``, doubt ``safety``); until it has seen both kinds, everything is unsafe.
"""

import numpy as np

from steerlab.learning.agents.common import WhereTeacherDrives
from steerlab.learning.agents.contract import Agent, GateInput, Watching
from steerlab.sim.records import Driver


class SafetyGate:
    """The teacher drives where doubt, the odds of being unsafe, is above 1."""

    watching = Watching.REACTING
    needs_doubt = True

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Nothing to prepare."""

    def who_drives(self, moment: GateInput) -> Driver:
        """Reads nothing of the teacher: that is the point."""
        return Driver.TEACHER if moment.doubt > 1.0 else Driver.ROBOT


def safe_dagger() -> Agent:
    """The safety model's gate; the teacher's steps only."""
    return Agent(name="safe-dagger", gate=SafetyGate(), rule=WhereTeacherDrives(), doubts="safety")
