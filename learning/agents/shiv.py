"""SHIV: ask for labels only where the learner is new to what it sees.

Laskey et al., "SHIV: reducing supervisor burden in DAgger using support vectors for query
efficient learning in high dimensional state spaces", ICRA 2016. Departure: one class is told by
distance to the nearest known row among the policy's own features (``novelty.py``), where the paper
fits a one-class SVM and also asks where the policy misfits its training data.
"""

import numpy as np

from steerlab.learning.agents.common import LearnerDrives, weighted
from steerlab.learning.agents.contract import Agent, Episode, Learner, Targets


class NovelLabels:
    """Feedback where the learner's doubt is above 1; elsewhere nobody is asked."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Doubt is the learner's as it drove."""
        asked = learner.doubt(episode.seen) > 1.0
        label = np.where(asked, episode.feedback[episode.rows], np.nan)
        return weighted(label, asked.astype(float), asked)


def shiv() -> Agent:
    """The learner drives; only novel states are labelled."""
    return Agent(name="shiv", gate=LearnerDrives(), rule=NovelLabels(), doubts="novelty")
