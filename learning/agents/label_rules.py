"""Label rules: what a learner imitates of an episode. ``catalogue.py`` combines them."""

import numpy as np

from steerlab.learning.agents.contract import Episode, Learner, Targets
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

LAMBDA = 1.0
FADE = 0.7
MISTAKE_WHEEL = 1.0
BAD_DECISIONS = 5  # before a takeover: the half second in which it was already wrong
MARGIN = 0.6
GOOD_WEIGHT = 0.1
BAD_WEIGHT = 0.3


class EveryLabel:
    """The teacher labels the whole drive, and labels are taken as they are."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The feedback at each decision; what the teacher did where the teacher drove."""
        live = episode.live[episode.rows]
        label = np.where(np.isfinite(live), live, episode.feedback[episode.rows])
        return _weighted(label, np.ones(len(label)), _everywhere(episode))


class WhereTeacherDrives:
    """Only the teacher's own driving is imitated."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The teacher's wheel at the decisions the teacher drove."""
        taught = episode.teacher_drives
        label = np.where(taught, episode.live[episode.rows], np.nan)
        return _weighted(label, taught.astype(float), taught)


class OracleLabelRule:
    """Ground truth; steps from which the ball cannot be reached are left out."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The oracle's wheel at each decision."""
        return _weighted(episode.truth, np.ones(len(episode.rows)), _everywhere(episode))


class MappedLabels:
    """The teacher's labels as a mapper corrects them; it never sees the truth.

    They are mapped after the round, the whole drive known, as calibration labels are: a window of
    ±1 s needs the labels that follow.
    """

    def __init__(self, mapper: LabelMapper) -> None:
        self._mapper = mapper

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Mapped feedback at each decision."""
        mapped = self._mapper.map(feedback_series(episode))
        return _weighted(mapped[episode.rows], np.ones(len(episode.rows)), _everywhere(episode))


class CoachedLabels:
    """Coaching: (label + lambda_i * learner's wheel) / (1 + lambda_i).

    Args:
        weight: lambda of the first round.
        fade: lambda is multiplied by this in each further round.
    """

    def __init__(self, weight: float = LAMBDA, fade: float = FADE) -> None:
        if weight < 0.0 or not 0.0 <= fade <= 1.0:
            raise InvalidConfig(f"lambda {weight} and fade {fade}: give lambda >= 0 and 0..1.")
        self._weight, self._fade = weight, fade
        self._labels = EveryLabel()

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Rounds count from 1; the demonstration has no learner and is imitated as it is."""
        raw = self._labels.target(episode, learner)
        easing = self._weight * self._fade ** (episode.round_number - 1)
        learner_wheel = np.where(
            np.isfinite(episode.learner_wheel), episode.learner_wheel, raw.target
        )
        target = (raw.target + easing * learner_wheel) / (1.0 + easing)
        return _weighted(target, raw.weight, raw.asked)


class NovelLabels:
    """SHIV: feedback where the learner's doubt is above 1; elsewhere no label is asked for."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """The feedback where the learner, as it drove, doubts."""
        asked = learner.doubt(episode.seen) > 1.0
        label = np.where(asked, episode.feedback[episode.rows], np.nan)
        return _weighted(label, asked.astype(float), asked)


class DemonstrationsAndCorrections:
    """What was shown on request, and feedback where the learner was confident and wrong."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Demonstrations and corrections, with equal weight."""
        shown = episode.teacher_drives
        feedback = episode.feedback[episode.rows]
        wrong = ~shown & (np.abs(feedback - episode.learner_wheel) > MISTAKE_WHEEL)
        asked = shown | wrong
        label = np.where(shown, episode.live[episode.rows], np.where(wrong, feedback, np.nan))
        return _weighted(label, asked.astype(float), asked)


class InterventionLabels:
    """EIL: the teacher's wheel, a hinge before a takeover, the learner's with little weight."""

    def target(self, episode: Episode, learner: Learner) -> Targets:
        """Only takeovers cost the teacher; the rest is inferred from the lack of one."""
        taught = episode.teacher_drives
        live = episode.live[episode.rows]
        learner_wheel = episode.learner_wheel
        bad = before_takeovers(taught)
        side = np.sign(next_teacher_wheel(live, taught) - learner_wheel)
        pushed = np.clip(learner_wheel + MARGIN * side, -WHEEL_LIMIT, WHEEL_LIMIT)
        target = np.where(taught, live, np.where(bad, pushed, learner_wheel))
        weight = np.where(taught, 1.0, np.where(bad, BAD_WEIGHT, GOOD_WEIGHT))
        return _weighted(target, weight, taught)


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


def feedback_series(episode: Episode) -> LabelSeries:
    """An episode's labels as mappers take them; the truth in it is blank."""
    rollout = episode.rollout
    return LabelSeries(
        person=episode.person,
        rollout=rollout.name,
        rate_hz=rollout.control_hz,
        label=episode.feedback,
        truth=np.full(rollout.steps, np.nan),
        valid=np.zeros(rollout.steps, dtype=bool),
        context=np.column_stack(
            [rollout.velocity[:, 2], rollout.velocity[:, 0], rollout.robot_wheel]
        ),
        context_names=("yaw_rate_radps", "speed_mps", "robot_wheel"),
    )


def _weighted(target: FloatArray, weight: FloatArray, asked: BoolArray) -> Targets:
    """Targets with whatever is not finite left out."""
    known = np.isfinite(target)
    return Targets(np.where(known, target, np.nan), np.where(known, weight, 0.0), asked)


def _everywhere(episode: Episode) -> BoolArray:
    """True at every decision."""
    return np.ones(len(episode.rows), dtype=bool)
