"""DAgger: the learner drives, the teacher labels where it went, all data are kept.

Ross, Gordon & Bagnell, "A reduction of imitation learning and structured prediction to no-regret
online learning", AISTATS 2011. In round i the teacher holds the wheel with probability beta_i at
each decision; ``dagger`` has beta_i = 0 after the demonstration, the paper's parameter-free choice,
and ``dagger-beta`` has 0.5^i.
"""

import numpy as np

from steerlab.learning.agents.common import EveryLabel, LearnerDrives
from steerlab.learning.agents.contract import Agent, GateInput, Watching
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import Driver

BETA = 0.5


class BetaMixture:
    """The teacher drives with probability ``beta ** round`` at each decision."""

    watching = Watching.REACTING
    needs_doubt = False

    def __init__(self, beta: float = BETA) -> None:
        if not 0.0 <= beta <= 1.0:
            raise InvalidConfig(f"beta is {beta}; it is a probability, from 0 to 1.")
        self._beta = beta
        self._share = 0.0
        self._rng = np.random.default_rng(0)

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Rounds count from 1."""
        self._share, self._rng = self._beta**round_number, rng

    def who_drives(self, moment: GateInput) -> Driver:
        """Drawn anew for each decision, as in the paper's algorithm."""
        return Driver.TEACHER if self._rng.random() < self._share else Driver.ROBOT


def dagger() -> Agent:
    """beta_i = 0 after the demonstration."""
    return Agent(name="dagger", gate=LearnerDrives(), rule=EveryLabel())


def dagger_beta() -> Agent:
    """beta_i = 0.5^i."""
    return Agent(name="dagger-beta", gate=BetaMixture(), rule=EveryLabel())
