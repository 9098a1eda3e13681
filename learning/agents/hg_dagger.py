"""HG-DAgger: the human decides when to take the wheel, and only what they did then is learned.

Kelly et al., "HG-DAgger: interactive imitation learning with human experts", ICRA 2019. A scripted
person's sense of danger is how far the learner's wheel is from what would be right, smoothed; they
take over above one level and hand back below another. Departures: the paper learns a doubt
threshold from takeovers for use after training, which nothing here needs; labels of a person at the
wheel are those of a driver, and never mapped.
"""

import numpy as np

from steerlab.learning.agents.common import WhereTeacherDrives
from steerlab.learning.agents.contract import Agent, GateInput, Watching
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import Driver

TAKE_WHEEL = 0.9  # wheel units of smoothed error; a hand on the wheel notices about a third of lock
GIVE_BACK = 0.35
SMOOTHING = 0.4  # weight of the newest decision, 0.1 s
LEAST_HELD = 8  # decisions; nobody hands back within a moment of taking over


class RiskGate:
    """Takes over when the smoothed error is large, hands back when it has been small."""

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
        """Trust, until something looks wrong."""
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


def hg_dagger() -> Agent:
    """Risk gate; the teacher's steps only."""
    return Agent(name="hg-dagger", gate=RiskGate(), rule=WhereTeacherDrives())
