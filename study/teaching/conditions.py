"""The conditions that a person can teach under: the learner, and what the person does."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class TeacherAction(StrEnum):
    """What the person does while the robot learns."""

    LABEL = "label"  # the robot drives; the wheel says how it should have steered
    DRIVE = "drive"  # the person drives
    TAKE_OVER = "take over"  # the robot drives, the person while holding the take-over button
    ARE_ASKED = "are asked"  # the robot decides who drives, and hands the wheel over and back


@dataclass(frozen=True, kw_only=True, slots=True)
class TeachingMode:
    """How a condition is taught.

    Attributes:
        learner: its name in ``learning.agents.catalogue``.
        hands: what the person does.
    """

    learner: str
    hands: TeacherAction

    @property
    def needs_w(self) -> bool:
        """Whether the teacher's labels are mapped by their w."""
        return self.learner in ("mind-meld", "mind-meld-mean")

    @property
    def before(self) -> tuple[str, ...]:
        """What the person reads before the first round."""
        return _BEFORE[self.hands]

    @property
    def during(self) -> str:
        """One line while it goes on."""
        return _DURING[self.hands]


FIRST_BEFORE = (
    "First show the robot how to get to the orange ball: you drive.",
    "The car keeps its speed by itself, and its steering shakes a little. If it does not reach "
    "the ball, you try again.",
)
FIRST_DURING = "You drive. Steer the car to the orange ball."
_BEFORE = {
    TeacherAction.LABEL: (
        "Now the robot drives, as well as it has learnt. Steer as you think it should have steered; "
        "the car does not follow your wheel.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
    TeacherAction.DRIVE: (
        "Show it again: you drive, in every drive.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
    TeacherAction.TAKE_OVER: (
        "Now the robot drives, as well as it has learnt. Whenever it needs you, hold the take-over "
        "button and steer; let go, and it drives on.",
        "After each drive it learns from what you did, and you can rest your hands.",
    ),
    TeacherAction.ARE_ASKED: (
        "Now the robot drives, as well as it has learnt. Where it is unsure it hands you the wheel: "
        "then the screen says that you drive. Keep steering as it should be all the time.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
}
_DURING = {
    TeacherAction.LABEL: "Steer as you think the car should have steered.",
    TeacherAction.DRIVE: FIRST_DURING,
    TeacherAction.TAKE_OVER: "Hold the take-over button and steer when the car needs you.",
    TeacherAction.ARE_ASKED: "Steer as it should be; the car follows you while it says that you drive.",
}

TAUGHT: Mapping[str, TeachingMode] = {
    "mind_meld": TeachingMode(learner="mind-meld", hands=TeacherAction.LABEL),
    "bc": TeachingMode(learner="bc", hands=TeacherAction.DRIVE),
    "dagger": TeachingMode(learner="dagger", hands=TeacherAction.LABEL),
    "oracle": TeachingMode(learner="oracle", hands=TeacherAction.LABEL),
    "mind_meld_mean": TeachingMode(learner="mind-meld-mean", hands=TeacherAction.LABEL),
    "hg_dagger": TeachingMode(learner="hg-dagger", hands=TeacherAction.TAKE_OVER),
    "eil": TeachingMode(learner="eil", hands=TeacherAction.TAKE_OVER),
    "safe_dagger": TeachingMode(learner="safe-dagger", hands=TeacherAction.ARE_ASKED),
    "ensemble_dagger": TeachingMode(learner="ensemble-dagger", hands=TeacherAction.ARE_ASKED),
    "confidence": TeachingMode(learner="confidence", hands=TeacherAction.ARE_ASKED),
    "coaching": TeachingMode(learner="coaching", hands=TeacherAction.LABEL),
    "shiv": TeachingMode(learner="shiv", hands=TeacherAction.LABEL),
}
"""By condition key; the paper compares ``mind_meld``, ``bc`` and ``dagger``.

``dagger-beta`` is not among them, since nobody can steer a wheel that is theirs at random for a
tenth of a second; nor is ``mapped:...``, since a study trains no such mappers.
"""
