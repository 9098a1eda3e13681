"""Confidence-based autonomy: the learner asks to be shown where it is unsure; mistakes are put right.

Chernova & Veloso, "Interactive policy learning through confidence-based autonomy", JAIR 2009.
Confident execution: below the confidence threshold the teacher drives. Corrective demonstration:
where the learner was confident and wrong, the teacher, who watches, gives the right wheel.
Departures: the paper classifies actions and thresholds a classifier's confidence and the distance to
the nearest neighbour; here the distance alone (``novelty.py``), and a mistake is a wheel more than
``MISTAKE_WHEEL`` from the teacher's feedback.
"""

import numpy as np

from steerlab.learning.agents.common import weighted
from steerlab.learning.agents.contract import Agent, Episode, GateInput, Learner, Targets, Watching
from steerlab.sim.records import Driver

MISTAKE_WHEEL = 1.0


class ConfidenceGate:
    """The teacher drives where the learner asks for it."""

    watching = Watching.REACTING
    needs_doubt = True

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Nothing to prepare."""

    def who_drives(self, moment: GateInput) -> Driver:
        """Doubt above 1 asks."""
        return Driver.TEACHER if moment.doubt > 1.0 else Driver.ROBOT


class DemonstrationsAndCorrections:
    """What was shown on request, and feedback where the learner was confident and wrong."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Both kinds weigh the same."""
        shown = episode.teacher_drives
        feedback = episode.feedback[episode.rows]
        wrong = ~shown & (np.abs(feedback - episode.learner_wheel) > MISTAKE_WHEEL)
        asked = shown | wrong
        label = np.where(shown, episode.live[episode.rows], np.where(wrong, feedback, np.nan))
        return weighted(label, asked.astype(float), asked)


def confidence_based_autonomy() -> Agent:
    """Novelty gate; demonstrations on request and corrections of mistakes."""
    return Agent(
        name="confidence",
        gate=ConfidenceGate(),
        rule=DemonstrationsAndCorrections(),
        doubts="novelty",
    )
