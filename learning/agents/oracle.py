"""Oracle-DAgger: DAgger with ground-truth labels; what perfect labels give, not a method."""

import numpy as np

from steerlab.learning.agents.common import LearnerDrives, everywhere, weighted
from steerlab.learning.agents.contract import Agent, Episode, Learner, Targets


class OracleLabelRule:
    """Ground truth; steps from which the ball cannot be reached are left out."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The oracle's wheel at each decision."""
        return weighted(episode.truth, np.ones(len(episode.rows)), everywhere(episode))


def oracle() -> Agent:
    """Its demonstration too is labelled by the oracle."""
    return Agent(
        name="oracle", gate=LearnerDrives(), rule=OracleLabelRule(), demonstration_is_oracle=True
    )
