"""Imitation by coaching: at first ask for what the learner can nearly do, then for more.

He, Daumé & Eisner, "Imitation learning by coaching", NeurIPS 2012. The hope action maximises
lambda_i times the learner's score plus the task's reward; with squared losses that is a weighted
mean of the learner's action and the teacher's label. lambda_i fades by ``FADE`` each round, so the
last rounds are DAgger; lambda 0 is DAgger from the start.
"""

import numpy as np

from steerlab.learning.agents.common import EveryLabel, LearnerDrives, weighted
from steerlab.learning.agents.contract import Agent, Episode, Learner, Targets
from steerlab.sim.errors import InvalidConfig

LAMBDA = 1.0
FADE = 0.7


class CoachedLabels:
    """(label + lambda_i * learner's wheel) / (1 + lambda_i)."""

    def __init__(self, weight: float = LAMBDA, fade: float = FADE) -> None:
        if weight < 0.0 or not 0.0 <= fade <= 1.0:
            raise InvalidConfig(f"lambda {weight} and fade {fade}: give lambda >= 0 and 0..1.")
        self._weight, self._fade = weight, fade
        self._labels = EveryLabel()

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Rounds count from 1; the demonstration has no learner and is imitated as it is."""
        raw = self._labels.target(episode, learner)
        easing = self._weight * self._fade ** (episode.round_number - 1)
        own = np.where(np.isfinite(episode.learner_wheel), episode.learner_wheel, raw.target)
        target = (raw.target + easing * own) / (1.0 + easing)
        return weighted(target, raw.weight, raw.asked)


def coaching(weight: float = LAMBDA) -> Agent:
    """The learner drives; labels meet it half-way, less and less."""
    return Agent(name="coaching", gate=LearnerDrives(), rule=CoachedLabels(weight))
