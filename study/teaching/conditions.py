"""What a person can teach with: the learners, and what each asks the person's hands to do."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Hands(StrEnum):
    """What the person does while the robot learns."""

    LABEL = "label"  # the robot drives; the wheel says how it should have steered
    DRIVE = "drive"  # the person drives
    TAKE_OVER = "take over"  # the robot drives, the person while holding the take-over button
    ARE_ASKED = "are asked"  # the robot says who drives, and hands the wheel over and back


@dataclass(frozen=True, kw_only=True, slots=True)
class TaughtBy:
    """How a condition is taught.

    Attributes:
        learner: its name in ``learning.agents.catalogue``.
        hands: what the person does.
    """

    learner: str
    hands: Hands

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
    Hands.LABEL: (
        "Now the robot drives, as well as it has learnt. Steer as you think it should have steered; "
        "the car does not follow your wheel.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
    Hands.DRIVE: (
        "Show it again: you drive, in every drive.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
    Hands.TAKE_OVER: (
        "Now the robot drives, as well as it has learnt. Whenever it needs you, hold the take-over "
        "button and steer; let go, and it drives on.",
        "After each drive it learns from what you did, and you can rest your hands.",
    ),
    Hands.ARE_ASKED: (
        "Now the robot drives, as well as it has learnt. Where it is unsure it hands you the wheel: "
        "then the screen says that you drive. Keep steering as it should be all the time.",
        "After each drive it learns from you, and you can rest your hands.",
    ),
}
_DURING = {
    Hands.LABEL: "Steer as you think the car should have steered.",
    Hands.DRIVE: FIRST_DURING,
    Hands.TAKE_OVER: "Hold the take-over button and steer when the car needs you.",
    Hands.ARE_ASKED: "Steer as it should be; the car follows you while it says that you drive.",
}

TAUGHT: Mapping[str, TaughtBy] = {
    "mind_meld": TaughtBy(learner="mind-meld", hands=Hands.LABEL),
    "bc": TaughtBy(learner="bc", hands=Hands.DRIVE),
    "dagger": TaughtBy(learner="dagger", hands=Hands.LABEL),
    "oracle": TaughtBy(learner="oracle", hands=Hands.LABEL),
    "mind_meld_mean": TaughtBy(learner="mind-meld-mean", hands=Hands.LABEL),
    "hg_dagger": TaughtBy(learner="hg-dagger", hands=Hands.TAKE_OVER),
    "eil": TaughtBy(learner="eil", hands=Hands.TAKE_OVER),
    "safe_dagger": TaughtBy(learner="safe-dagger", hands=Hands.ARE_ASKED),
    "ensemble_dagger": TaughtBy(learner="ensemble-dagger", hands=Hands.ARE_ASKED),
    "confidence": TaughtBy(learner="confidence", hands=Hands.ARE_ASKED),
    "coaching": TaughtBy(learner="coaching", hands=Hands.LABEL),
    "shiv": TaughtBy(learner="shiv", hands=Hands.LABEL),
}
"""By condition key; the paper compares ``mind_meld``, ``bc`` and ``dagger``.

``dagger-beta`` is not among them, for nobody can hold a wheel that is theirs at random for a tenth
of a second; nor are ``mapped:...``, whose mappers a study does not train.
"""
