"""Planted effects: known correlations between how scripted participants teach and answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import Literal, get_args

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import HIGH, HUMAN, LOW, PAPER, PEOPLE, PopulationKind
from steerlab.sim.scripted_teacher import TeacherStyle
from steerlab.study.surveys.questionnaire import Questionnaire

StyleParameter = Literal["gain", "delay"]

_LEVELS = {"low": LOW, "human": HUMAN, "high": HIGH, "people": PEOPLE, "sparse": HUMAN}


@dataclass(frozen=True, kw_only=True, slots=True)
class PlantedEffect:
    """A style parameter correlates with the trait behind a scale.

    The score is the trait with measurement error: it correlates with the style by about
    ``correlation`` times the root of the scale's reliability.

    Attributes:
        scale: ``<questionnaire>.<scale>``, such as ``mini_ipip_5.extraversion``; a translation has the
            effects on what it translates.
        style: ``gain`` (its logarithm: above 0 over-corrects) or ``delay``.
        correlation: with the trait, over the population.
    """

    scale: str
    style: StyleParameter
    correlation: float

    def __post_init__(self) -> None:
        if self.scale.count(".") != 1 or not all(self.scale.split(".")):
            raise InvalidConfig(
                f"A planted effect is on {self.scale!r}; name a scale as <questionnaire>.<scale>, "
                "such as mini_ipip_5.extraversion."
            )
        if self.style not in get_args(StyleParameter):
            raise InvalidConfig(
                f"A planted effect is of {self.style!r}; choose one of "
                f"{', '.join(get_args(StyleParameter))}."
            )
        if not -1.0 <= self.correlation <= 1.0:
            raise InvalidConfig(
                f"The planted correlation with {self.scale} is {self.correlation}; it must be "
                "between -1 and 1."
            )

    @property
    def questionnaire(self) -> str:
        """The questionnaire's key."""
        return self.scale.partition(".")[0]

    @property
    def scale_key(self) -> str:
        """The scale's key within its questionnaire."""
        return self.scale.partition(".")[2]


def check_effects(
    effects: Sequence[PlantedEffect], questionnaires: Mapping[str, Questionnaire]
) -> None:
    """Refuse effects that a study with these questionnaires would not have.

    Raises:
        InvalidConfig: an effect is on an unknown questionnaire or scale, on a sub-scale, twice of
            one style on one scale, or those on one scale explain more than all of it.
    """
    known = dict.fromkeys(questionnaire.original for questionnaire in questionnaires.values())
    for effect in effects:
        if effect.questionnaire not in known:
            raise InvalidConfig(
                f"The planted effect on {effect.scale} needs the questionnaire "
                f"{effect.questionnaire!r}; the study has {', '.join(known) or 'none'}."
            )
    for questionnaire in questionnaires.values():
        effects_on(questionnaire, effects)


def effects_on(
    questionnaire: Questionnaire, effects: Sequence[PlantedEffect]
) -> dict[str, list[PlantedEffect]]:
    """The effects on each trait of a questionnaire, by scale; none for most.

    Raises:
        InvalidConfig: as ``check_effects``.
    """
    by_scale: dict[str, list[PlantedEffect]] = {scale: [] for scale in trait_scales(questionnaire)}
    for effect in effects:
        if effect.questionnaire != questionnaire.original:
            continue
        if effect.scale_key not in by_scale:
            raise InvalidConfig(
                f"No effect can be planted on {effect.scale}; scales of {questionnaire.key} with "
                f"a trait of their own are: {', '.join(by_scale) or 'none'}."
            )
        by_scale[effect.scale_key].append(effect)
    for scale, several in by_scale.items():
        styles = [effect.style for effect in several]
        if len(set(styles)) != len(styles):
            raise InvalidConfig(
                f"Two planted effects tie {questionnaire.key}.{scale} to one style; keep one."
            )
        explained = sum(effect.correlation**2 for effect in several)
        if explained > 1.0:
            raise InvalidConfig(
                f"The effects planted on {questionnaire.key}.{scale} explain {explained:.2f} of "
                "its variance; the squares of their correlations must add up to 1 at most."
            )
    return by_scale


def trait_scales(questionnaire: Questionnaire) -> dict[str, list[str]]:
    """The items that show each trait, by scale: an item shows that of the first scale that has it.

    So all twelve items of trust show the trait of its total; its two sub-scales have none.
    """
    items_of: dict[str, list[str]] = {}
    taken: set[str] = set()
    for scale in questionnaire.scales:
        items = [item for item in scale.items if item not in taken]
        taken.update(items)
        if items:
            items_of[scale.key] = items
    return items_of


def style_score(style: TeacherStyle, parameter: StyleParameter, kind: PopulationKind) -> float:
    """A style parameter in standard deviations from the mean of its population."""
    if kind == "paper":
        low, high = PAPER.magnitude
        # E[log²u] of u uniform on [low, high]; the sign of log gain is a fair coin
        log_gain_std = sqrt((_log_squared(high) - _log_squared(low)) / (high - low))
        delay_mean_s, delay_std_s = 0.0, PAPER.shift_s * sqrt(2.0 / 3.0)
    else:
        config = _LEVELS[kind]
        log_gain_std = config.log_gain_std
        delay_mean_s, delay_std_s = config.delay_mean_s, config.delay_std_s
    if parameter == "gain":
        return log(style.gain) / log_gain_std
    return (style.delay_s - delay_mean_s) / delay_std_s


def _log_squared(bound: float) -> float:
    """The antiderivative of log²u."""
    return bound * (log(bound) ** 2 - 2.0 * log(bound) + 2.0)
