"""The sections of a protocol: consent, practice, display, wheel, mapper, and the analysis plan."""

from dataclasses import dataclass
from typing import Literal

from steerlab.sim.camera_config import View
from steerlab.sim.errors import InvalidValue, check_words
from steerlab.teleop.devices.force_feedback import DEFAULT_AUTOCENTRE
from steerlab.teleop.screen.config import ScreenConfig

CORRECTIONS = ("holm", "bh", "none")


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsentText:
    """What participants agree to; a changed text is a new version."""

    version: int
    text: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.version < 1:
            raise InvalidValue("version", self.version, "a whole number from 1")
        if not self.text or not all(one.strip() for one in self.text):
            raise InvalidValue("text", list(self.text), "one or more paragraphs, none blank")


@dataclass(frozen=True, kw_only=True, slots=True)
class PracticePlan:
    """How many balls to reach, with pedals or at cruise speed, and how long one may take."""

    balls: int = 5
    pedals: bool = True
    time_limit_s: float = 120.0

    def __post_init__(self) -> None:
        if self.balls < 1:
            raise InvalidValue("balls", self.balls, "at least 1")
        if not self.time_limit_s > 0.0:
            raise InvalidValue("time_limit_s", self.time_limit_s, "positive")


@dataclass(frozen=True, kw_only=True, slots=True)
class DisplayPlan:
    """What is shown: labels may depend on it, so it is the same for all."""

    show_agent_wheel: bool = False
    view: View = "front"
    width: int = 960
    height: int = 540
    full_screen: bool = False
    text_scale: float = 1.0
    countdown_s: float = 3.0

    def __post_init__(self) -> None:
        if not self.countdown_s >= 0.0:
            raise InvalidValue("countdown_s", self.countdown_s, "0 or more")
        self.screen()

    def screen(self) -> ScreenConfig:
        """The window.

        Raises:
            InvalidConfig: it is too small or too large.
        """
        return ScreenConfig(
            width=self.width,
            height=self.height,
            full_screen=self.full_screen,
            view=self.view,
            text_scale=self.text_scale,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class WheelPlan:
    """Force feedback: whether a wheel's motor pulls to the centre, and how hard, 0 to 1."""

    force_feedback: bool = True
    autocentre: float = DEFAULT_AUTOCENTRE

    def __post_init__(self) -> None:
        if not 0.0 <= self.autocentre <= 1.0:
            raise InvalidValue("autocentre", self.autocentre, "from 0 to 1")

    @property
    def strength(self) -> float | None:
        """What to ask of the device; None leaves it alone."""
        return self.autocentre if self.force_feedback else None


@dataclass(frozen=True, kw_only=True, slots=True)
class MapperPlan:
    """How the network is trained on the training participants.

    Attributes:
        epochs: None takes the preset's.
        minimum_people: with fewer finished training participants nothing is trained.
    """

    preset: Literal["lab", "paper"] = "lab"
    epochs: int | None = None
    minimum_people: int = 8

    def __post_init__(self) -> None:
        if self.epochs is not None and self.epochs < 1:
            raise InvalidValue("epochs", self.epochs, "at least 1")
        if self.minimum_people < 2:
            raise InvalidValue("minimum_people", self.minimum_people, "at least 2")


@dataclass(frozen=True, kw_only=True, slots=True)
class Hypothesis:
    """What was expected before anything was seen, and how it will be tested."""

    id: str
    text: str
    outcome: str
    test: str
    primary: bool = False

    def __post_init__(self) -> None:
        for name in ("id", "text", "outcome", "test"):
            check_words(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True, slots=True)
class AnalysisPlan:
    """Frozen with the protocol, before the first participant.

    Attributes:
        correction: for several tests of one family.
        exclusions: rules, in words.
    """

    alpha: float = 0.05
    correction: str = "holm"
    hypotheses: tuple[Hypothesis, ...] = ()
    exclusions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 < self.alpha < 1.0:
            raise InvalidValue("alpha", self.alpha, "between 0 and 1")
        if self.correction not in CORRECTIONS:
            raise InvalidValue("correction", self.correction, f"one of {', '.join(CORRECTIONS)}")
        for place, rule in enumerate(self.exclusions):
            check_words(f"exclusions[{place}]", rule)
        ids = [one.id for one in self.hypotheses]
        for place, id_ in enumerate(ids):
            if id_ in ids[:place]:
                raise InvalidValue(f"hypotheses[{place}].id", id_, "another one: it is taken")
