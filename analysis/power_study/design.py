"""A planned study as ``steerlab power`` simulates it."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind

Style = Literal["gain", "delay"]
_TWELVE = 12.0  # rollouts with which ``HOLDING`` was measured


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A planted correlation of a style parameter with the trait behind a questionnaire's scale.

    Attributes:
        scale: what it is called.
        r: with the trait; the score, measured with error, correlates by r times the root of its
            reliability.
    """

    scale: str
    style: Style
    r: float

    @classmethod
    def parse(cls, text: str) -> "Effect":
        """From ``SCALE:STYLE:R``, such as ``mini_ipip_5.neuroticism:gain:0.4``.

        Raises:
            InvalidConfig: it is none.
        """
        scale, _, rest = text.partition(":")
        style, _, number = rest.partition(":")
        try:
            r = float(number)
        except ValueError:
            r = 2.0
        if not scale or style not in get_args(Style) or not -1.0 <= r <= 1.0:
            raise InvalidConfig(
                f"No planted effect {text!r}; give SCALE:STYLE:R with a style of gain or delay and "
                f"R from -1 to 1, such as mini_ipip_5.neuroticism:gain:0.4."
            )
        return cls(scale=scale, style="gain" if style == "gain" else "delay", r=r)


@dataclass(frozen=True, kw_only=True)
class ConditionMean:
    """The share of drives that reach the ball under a condition, for a person of average skill."""

    name: str
    success: float

    @classmethod
    def parse(cls, text: str) -> "ConditionMean":
        """From ``NAME:SHARE``, such as ``mind_meld:0.7``.

        Raises:
            InvalidConfig: it is none.
        """
        name, _, number = text.partition(":")
        try:
            success = float(number)
        except ValueError:
            success = -1.0
        if not name or not 0.0 < success < 1.0:
            raise InvalidConfig(
                f"No condition {text!r}; give NAME:SHARE with the share of drives that reach the "
                f"ball between 0 and 1, such as mind_meld:0.7."
            )
        return cls(name=name, success=success)


@dataclass(frozen=True, kw_only=True)
class Holding:
    """How well w and the style metrics hold the two style parameters: R², 0 to 1.

    Attributes:
        w_gain, w_delay: of w, after twelve rollouts.
        metric_gain, metric_delay: of the amplitude metric and of the lag.
    """

    w_gain: float
    w_delay: float
    metric_gain: float
    metric_delay: float

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 < value < 1.0:
                raise InvalidConfig(f"{name} is {value}; a share of variance lies between 0 and 1.")


# Measured on scripted teachers. w: adjusted R² of gain and delay over 34 people, the mean of
# `steerlab simulate --ladder quick --noise KIND` with seeds 5 and 6. Metrics: R² over 200 people.
# `people` and `sparse` were not measured, so nothing is said of them.
HOLDING: dict[str, Holding] = {
    "paper": Holding(w_gain=0.99, w_delay=0.97, metric_gain=0.99, metric_delay=0.99),
    "low": Holding(w_gain=0.97, w_delay=0.89, metric_gain=0.98, metric_delay=0.94),
    "human": Holding(w_gain=0.89, w_delay=0.92, metric_gain=0.95, metric_delay=0.92),
    "high": Holding(w_gain=0.69, w_delay=0.90, metric_gain=0.82, metric_delay=0.85),
}

AVERAGED_OUT = 0.25
"""Share of what w and metrics miss that is taken to average out over rollouts. With 4, 6 and 12
rollouts at human noise w held gain with R² .92, .93, .90 and delay with .91, .92, .93: what it misses
is mostly how people differ besides gain and delay, so this is cautious."""


@dataclass(frozen=True, kw_only=True)
class PowerDesign:
    """The settings that decide the results of a power analysis.

    Attributes:
        people: sample sizes to try, rising.
        rollouts: of the calibration; see ``AVERAGED_OUT``.
        noise: the population whose ``HOLDING`` is used.
        family: how many tests Holm's correction goes over; those that are not planted are null.
        dimensions: of w.
        reliability: Cronbach's alpha of the scales.
        conditions: success of each; compared within people.
        ours: the condition that is to be better than each of the others.
        starts: evaluation drives of each person and condition.
        person_sd, interaction_sd: of log odds: how people differ, and how much more under one
            condition than another.
        studies: simulated for each sample size.
    """

    people: tuple[int, ...] = (12, 20, 34, 50, 70, 100, 140)
    rollouts: int = 12
    noise: PopulationKind = "human"
    effects: tuple[Effect, ...] = ()
    family: int = 11
    dimensions: int = 4
    reliability: float = 0.8
    conditions: tuple[ConditionMean, ...] = ()
    ours: str = "mind_meld"
    starts: int = 10
    person_sd: float = 0.5
    interaction_sd: float = 0.5
    studies: int = 1000
    alpha: float = 0.05
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (
            ("rollouts", 1),
            ("dimensions", 2),
            ("starts", 1),
            ("studies", 100),
            ("seed", 0),
            ("family", len(self.effects) + 2),
        ):
            if getattr(self, name) < least:
                raise InvalidConfig(
                    f"{name} is {getattr(self, name)}; it must be at least {least}."
                )
        fewest = self.dimensions + 3
        if list(self.people) != sorted(set(self.people)) or not self.people:
            raise InvalidConfig(f"people is {[*self.people]}; give rising sample sizes, each once.")
        if self.people[0] < fewest:
            raise InvalidConfig(
                f"people begins with {self.people[0]}; {self.dimensions} dimensions need {fewest}."
            )
        if self.noise not in HOLDING:
            raise InvalidConfig(f"noise is {self.noise!r}; choose one of {', '.join(HOLDING)}.")
        for name in ("reliability", "alpha"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it lies between 0 and 1.")
        for name in ("person_sd", "interaction_sd"):
            if not getattr(self, name) >= 0.0:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it must be at least 0.")
        self._check_effects()
        names = [condition.name for condition in self.conditions]
        if len(set(names)) != len(names) or len(names) == 1:
            raise InvalidConfig(f"conditions is {names}; name two or more, each once.")
        if names and self.ours not in names:
            raise InvalidConfig(f"ours is {self.ours!r}; it must be one of {', '.join(names)}.")

    def _check_effects(self) -> None:
        scales = {effect.scale for effect in self.effects}
        for scale in scales:
            of_scale = [effect for effect in self.effects if effect.scale == scale]
            if len({effect.style for effect in of_scale}) != len(of_scale):
                raise InvalidConfig(f"Two effects tie {scale} to one style; keep one.")
            if sum(effect.r**2 for effect in of_scale) > 1.0:
                raise InvalidConfig(
                    f"The effects on {scale} explain more than all of it; lower their r."
                )

    @property
    def scales(self) -> tuple[str, ...]:
        """Planted scales, in the order given."""
        return tuple(dict.fromkeys(effect.scale for effect in self.effects))

    @property
    def error_factor(self) -> float:
        """Error variance of w and metrics, relative to that after twelve rollouts."""
        return 1.0 - AVERAGED_OUT + AVERAGED_OUT * _TWELVE / self.rollouts

    @property
    def holding(self) -> Holding:
        """How well w and metrics hold the styles of the population."""
        return HOLDING[self.noise]

    def identity(self) -> dict[str, Any]:
        """Settings that must be equal for a run to be continued: all but ``people`` and ``studies``."""
        values = asdict(self)
        del values["people"], values["studies"]
        return values
