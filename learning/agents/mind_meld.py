"""MIND MELD as a condition (paper, Algorithm 1), and the same loop with any other label mapper.

The learner drives, the teacher labels, and the labels are mapped before they are imitated. They are
mapped after the round, the whole drive known, as calibration labels are: a window of ±1 s needs the
labels that follow. The demonstration stays as it was driven: w describes how someone corrects a
drive, not how they drive.
"""

import numpy as np

from steerlab.learning.agents.common import LearnerDrives, everywhere, weighted
from steerlab.learning.agents.contract import Agent, Episode, Learner, Targets
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.series import LabelSeries


class MappedLabels:
    """The teacher's labels as a mapper corrects them; it never sees the truth."""

    def __init__(self, mapper: LabelMapper) -> None:
        self._mapper = mapper

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Mapped feedback at each decision."""
        mapped = self._mapper.map(feedback_series(episode))
        return weighted(mapped[episode.rows], np.ones(len(episode.rows)), everywhere(episode))


def feedback_series(episode: Episode) -> LabelSeries:
    """An episode's labels as mappers take them; the truth in it is blank."""
    rollout = episode.rollout
    unknown = np.full(rollout.steps, np.nan)
    return LabelSeries(
        person=episode.person,
        rollout=rollout.name,
        rate_hz=rollout.control_hz,
        label=episode.feedback,
        truth=unknown,
        valid=np.zeros(rollout.steps, dtype=bool),
        context=np.column_stack(
            [rollout.velocity[:, 2], rollout.velocity[:, 0], rollout.robot_wheel]
        ),
        context_names=("yaw_rate_radps", "speed_mps", "robot_wheel"),
    )


def mapped(name: str, mapper: LabelMapper) -> Agent:
    """DAgger on mapped labels: ``mind-meld``, ``mind-meld-mean``, ``mapped:<baseline>``."""
    return Agent(name=name, gate=LearnerDrives(), rule=MappedLabels(mapper))
