"""EIL: learn from when the expert steps in, and also from when they do not.

Spencer et al., "Learning from interventions: human-robot interaction as both explicit and implicit
feedback", RSS 2020 ("Expert intervention learning", Autonomous Robots 2022). Where the teacher
drove, imitate; where the learner drove undisturbed it was good enough; just before a takeover it
was not. Departure: the paper learns a value function with hinge costs over actions; here the hinge
before a takeover is made linear at the moment of collection: the target lies ``MARGIN`` away from
the learner's action, on the side the teacher then turned to.
"""

import numpy as np

from steerlab.learning.agents.common import weighted
from steerlab.learning.agents.contract import Agent, Episode, Learner, Targets
from steerlab.learning.agents.hg_dagger import RiskGate
from steerlab.sim.rollout import BoolArray
from steerlab.sim.vehicle import WHEEL_LIMIT

BAD_DECISIONS = 5  # before a takeover: the half second in which it was already wrong
MARGIN = 0.6
GOOD_WEIGHT = 0.1
BAD_WEIGHT = 0.3


class InterventionLabels:
    """Teacher's wheel, weight 1; hinge before a takeover; a little of the learner's own elsewhere."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Only takeovers are asked for; the rest is read off what was not done."""
        taught = episode.teacher_drives
        live = episode.live[episode.rows]
        own = episode.learner_wheel
        bad = before_takeovers(taught)
        side = np.sign(next_teacher_wheel(live, taught) - own)
        pushed = np.clip(own + MARGIN * side, -WHEEL_LIMIT, WHEEL_LIMIT)
        target = np.where(taught, live, np.where(bad, pushed, own))
        weight = np.where(taught, 1.0, np.where(bad, BAD_WEIGHT, GOOD_WEIGHT))
        return weighted(target, weight, taught)


def before_takeovers(taught: BoolArray) -> BoolArray:
    """The learner's decisions up to ``BAD_DECISIONS`` before one of the teacher's."""
    soon = np.zeros_like(taught)
    for ahead in range(1, BAD_DECISIONS + 1):
        soon[:-ahead] |= taught[ahead:]
    return soon & ~taught


def next_teacher_wheel(live: np.ndarray, taught: BoolArray) -> np.ndarray:
    """The wheel at the next takeover after each decision; NaN where none follows."""
    following, now = np.full(len(live), np.nan), np.nan
    for row in range(len(live) - 1, -1, -1):
        now = live[row] if taught[row] else now
        following[row] = now
    return following


def eil() -> Agent:
    """HG-DAgger's gate, and labels from interventions and from their absence."""
    return Agent(name="eil", gate=RiskGate(), rule=InterventionLabels())
