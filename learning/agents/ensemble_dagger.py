"""EnsembleDAgger: the learner drives while its policies agree and it is near the teacher's wheel.

Menda, Driggs-Campbell & Kochenderfer, "EnsembleDAgger: a Bayesian approach to safe imitation
learning", IROS 2019. Departures: three policies that differ in weights and batches (the paper uses
ten); only what the teacher did with the wheel in hand is learned, so a round costs what it asks.
"""

import numpy as np

from steerlab.learning.agents.common import WhereTeacherDrives
from steerlab.learning.agents.contract import Agent, GateInput, Watching
from steerlab.sim.records import Driver

MEMBERS = 3
DISCREPANCY_WHEEL = 1.0


class DoubtGate:
    """The teacher drives where doubt is above 1 or the two wheels are far apart."""

    watching = Watching.REACTING
    needs_doubt = True

    def __init__(self, discrepancy: float = DISCREPANCY_WHEEL) -> None:
        self._discrepancy = discrepancy

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Nothing to prepare."""

    def who_drives(self, moment: GateInput) -> Driver:
        """The paper's decision rule: both must hold for the learner to drive."""
        apart = abs(moment.learner_wheel - moment.teacher_wheel)
        safe = moment.doubt <= 1.0 and apart <= self._discrepancy
        return Driver.ROBOT if safe else Driver.TEACHER


def ensemble_dagger() -> Agent:
    """Doubt is the spread of the policies, 1 at ``learner.SPREAD_WHEEL``."""
    return Agent(
        name="ensemble-dagger",
        gate=DoubtGate(),
        rule=WhereTeacherDrives(),
        ensemble=MEMBERS,
        doubts="spread",
    )
