"""SHIV: ask for labels only where the learner is new to what it sees.

Laskey et al., "SHIV: reducing supervisor burden in DAgger using support vectors for query
efficient learning in high dimensional state spaces", ICRA 2016. As there, what the policy still gets
wrong after training counts as unknown, so labels are asked for near it too. Departure: one class is
told by distance to the nearest row that was learnt, among the policy's own features
(``novelty.py``), where the paper fits a one-class SVM.
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
    """The learner drives; only states that are new or not learnt yet are labelled."""
    return Agent(name="shiv", gate=LearnerDrives(), rule=NovelLabels(), doubts="risk")
