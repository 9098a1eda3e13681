"""Gates and label rules that several learners share."""

import numpy as np

from steerlab.learning.agents.contract import Episode, GateInput, Learner, Targets, Watching
from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import Driver
from steerlab.sim.rollout import BoolArray


class LearnerDrives:
    """The learner drives, always."""

    watching = Watching.NOTHING
    needs_doubt = False

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Nothing to prepare."""

    def who_drives(self, moment: GateInput) -> Driver:
        """The robot."""
        return Driver.ROBOT


class TeacherDrives:
    """The teacher drives, always."""

    watching = Watching.REACTING
    needs_doubt = False

    def begin(self, round_number: int, rng: np.random.Generator) -> None:
        """Nothing to prepare."""

    def who_drives(self, moment: GateInput) -> Driver:
        """The teacher."""
        return Driver.TEACHER


def weighted(target: FloatArray, weight: FloatArray, asked: BoolArray) -> Targets:
    """Targets with whatever is not finite left out."""
    known = np.isfinite(target)
    return Targets(np.where(known, target, np.nan), np.where(known, weight, 0.0), asked)


def everywhere(episode: Episode) -> BoolArray:
    """Every decision."""
    return np.ones(len(episode.rows), dtype=bool)


class EveryLabel:
    """The teacher labels the whole drive, and labels are taken as they are."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The feedback at each decision; what the teacher did where the teacher drove."""
        live = episode.live[episode.rows]
        label = np.where(np.isfinite(live), live, episode.feedback[episode.rows])
        return weighted(label, np.ones(len(label)), everywhere(episode))


class WhereTeacherDrives:
    """Only what the teacher did with the wheel in hand."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The teacher's wheel at the decisions the teacher drove."""
        taught = episode.teacher_drives
        label = np.where(taught, episode.live[episode.rows], np.nan)
        return weighted(label, taught.astype(float), taught)
