"""What scripted participants answer: a seeded model with as much measurement error as people's.

A trait of a person is a standard normal number. Each item of its scale shows the trait with
independent noise, cut into the item's points by equally spaced thresholds (a graded response
model); the loading follows from the reliability asked for. Facts, such as an age, have no trait
behind them. These are simulated answers: they say nothing about people, and a report says that
they were simulated.
"""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from math import exp, pi, sqrt
from typing import get_args

import numpy as np
from scipy.special import ndtr

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind
from steerlab.sim.scripted_teacher import TeacherStyle
from steerlab.study.planted_effects import (
    PlantedEffect,
    effects_on,
    style_score,
    trait_scales,
)
from steerlab.study.surveys.answer_format import (
    Choice,
    FreeText,
    Likert,
    Number,
    Slider,
    Value,
)
from steerlab.study.surveys.questionnaire import Item, Questionnaire

SUCCESS_SHIFT = (("raw_tlx.workload", -0.8), ("trust.total", 0.8), ("fluency.fluency", 1.0))

# 34 people: age 28 ± 11.9, 29.4 % women (the paper's Results). Other shares are rough guesses.
_AGE_MEAN_YEARS, _AGE_STD_YEARS, _YOUNGEST_YEARS = 28.0, 11.9, 18.0
_SHARES: dict[tuple[str, str], dict[str, float]] = {
    ("demographics", "gender"): {
        "woman": 0.29,
        "man": 0.67,
        "non_binary": 0.02,
        "prefer_not_to_say": 0.02,
    },
    ("demographics", "handedness"): {"right": 0.89, "left": 0.10, "both": 0.01},
    ("demographics", "driving_licence"): {"yes": 0.85, "no": 0.15},
    ("demographics", "vision"): {"none_needed": 0.52, "corrected": 0.45, "not_corrected": 0.03},
}


@dataclass(frozen=True, kw_only=True)
class AnswerModel:
    """How scripted participants answer; every number is an assumption.

    Attributes:
        population: its spread of styles is the unit of planted effects.
        effects: the planted correlations.
        reliability: Cronbach's alpha of scales with a trait behind them.
        span: the outermost thresholds, in standard deviations.
        stability: share of a trait's variance that is the person's, not the occasion's, in answers
            about a condition.
        success_shift: (scale, standard deviations), by which complete success moves the trait
            from where no success puts it.
    """

    population: PopulationKind = "human"
    effects: tuple[PlantedEffect, ...] = ()
    reliability: float = 0.8
    span: float = 1.8
    stability: float = 0.6
    success_shift: tuple[tuple[str, float], ...] = SUCCESS_SHIFT

    def __post_init__(self) -> None:
        if self.population not in get_args(PopulationKind):
            raise InvalidConfig(
                f"AnswerModel.population is {self.population!r}; choose one of "
                f"{', '.join(get_args(PopulationKind))}."
            )
        for name in ("reliability", "stability"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise InvalidConfig(
                    f"AnswerModel.{name} is {getattr(self, name)}; it must be from 0 to below 1."
                )
        if not 0.5 <= self.span <= 5.0:
            raise InvalidConfig(f"AnswerModel.span is {self.span}; it must be from 0.5 to 5.")


@dataclass(frozen=True)
class ScriptedRespondent:
    """A scripted participant's answers.

    They depend on (seed, name, questionnaire, phase) alone, never on the order of calls, so a
    study that is interrupted and resumed has the answers it would have had. A translation has those
    to what it translates.
    """

    name: str
    style: TeacherStyle | None
    seed: int
    model: AnswerModel = AnswerModel()

    def answers(
        self, questionnaire: Questionnaire, *, phase: str = "", success: float | None = None
    ) -> dict[str, Value]:
        """All answers to a questionnaire, in the order of its file.

        Args:
            phase: such as ``post-2``.
            success: of the condition that the questionnaire is about, from 0 to 1.
        """
        traits = draw_traits(
            questionnaire, self.style, self._rng("traits", questionnaire.original), model=self.model
        )
        rng = self._rng("answers", questionnaire.original, phase)
        return answers(
            questionnaire, self.style, rng, model=self.model, traits=traits, success=success
        )

    def _rng(self, *names: str) -> np.random.Generator:
        digest = sha256("\0".join((self.name, *names)).encode()).digest()
        words = [int.from_bytes(digest[at : at + 4], "little") for at in range(0, 16, 4)]
        return np.random.default_rng([self.seed, *words])


def draw_traits(
    questionnaire: Questionnaire,
    style: TeacherStyle | None,
    rng: np.random.Generator,
    *,
    model: AnswerModel,
) -> dict[str, float]:
    """A person's traits, by scale: standard normal, tied to the style where that is planted.

    Raises:
        InvalidConfig: an effect cannot be planted, or needs a style and there is none.
    """
    traits: dict[str, float] = {}
    for scale, effects in effects_on(questionnaire, model.effects).items():
        unplanted = rng.standard_normal()
        planted, explained = 0.0, 0.0
        for effect in effects:
            if style is None:
                raise InvalidConfig(
                    f"The effect on {effect.scale} needs a teacher with a known {effect.style}."
                )
            r = effect.correlation
            planted += r * style_score(style, effect.style, model.population)
            explained += r * r
        traits[scale] = planted + sqrt(max(1.0 - explained, 0.0)) * unplanted
    return traits


def answers(
    questionnaire: Questionnaire,
    style: TeacherStyle | None,
    rng: np.random.Generator,
    *,
    model: AnswerModel | None = None,
    traits: Mapping[str, float] | None = None,
    success: float | None = None,
) -> dict[str, Value]:
    """Answers to the items of a questionnaire that they show, in file order; each is allowed.

    Attention checks are answered rightly.

    Args:
        traits: the person's, by scale; drawn if not given.
        success: of the condition that the questionnaire is about, from 0 to 1; None if it is
            about none.

    Raises:
        InvalidConfig: as ``draw_traits``, or ``success`` is not from 0 to 1.
    """
    model = model or AnswerModel()
    if traits is None:
        traits = draw_traits(questionnaire, style, rng, model=model)
    if success is not None:
        traits = _on_occasion(questionnaire, traits, success, rng, model)
    scale_of = {
        item: (scale, len(items))
        for scale, items in trait_scales(questionnaire).items()
        for item in items
    }
    given: dict[str, Value] = {}
    for item in questionnaire.items:
        if item.attention is not None:
            value = item.attention
        elif isinstance(item.format, (Likert, Slider)):
            scale, size = scale_of.get(item.id, (None, 1))
            backwards = scale is not None and item.id in questionnaire.scale(scale).reversed
            trait = rng.standard_normal() if scale is None else traits[scale]
            value = _on_scale(item.format, trait, size, model, rng, backwards=backwards)
        else:
            value = _fact(questionnaire.original, item, rng)
        if value is not None:
            given[item.id] = questionnaire.check(item.id, value)
    return questionnaire.counted(given)


def _fact(questionnaire: str, item: Item, rng: np.random.Generator) -> Value | None:
    """An answer to a choice, a number or a text; None leaves an optional text out.

    Answers to the shipped demographics are plausible; any other item is answered evenly.
    """
    form = item.format
    if isinstance(form, Choice):
        names = [option.value for option in form.options]
        shares = _SHARES.get((questionnaire, item.id))
        weights = None if shares is None else [shares.get(name, 0.0) for name in names]
        return str(rng.choice(names, p=weights))
    if isinstance(form, Number):
        if (questionnaire, item.id) == ("demographics", "age"):
            above = _AGE_MEAN_YEARS - _YOUNGEST_YEARS
            age = _YOUNGEST_YEARS + rng.gamma(
                (above / _AGE_STD_YEARS) ** 2, _AGE_STD_YEARS**2 / above
            )
            return int(min(age, form.maximum))
        if form.whole:
            return int(rng.integers(int(np.ceil(form.minimum)), int(form.maximum), endpoint=True))
        return float(rng.uniform(form.minimum, form.maximum))
    if not isinstance(form, FreeText):
        raise TypeError(f"{item.id!r} is on a scale: {form}.")
    return "(scripted)"[: form.longest] if item.required else None


def _on_occasion(
    questionnaire: Questionnaire,
    traits: Mapping[str, float],
    success: float,
    rng: np.random.Generator,
    model: AnswerModel,
) -> dict[str, float]:
    """The traits as answers about a condition show them: varied anew, and moved by success."""
    if not 0.0 <= success <= 1.0:
        raise InvalidConfig(f"The success of a condition is {success}; it must be from 0 to 1.")
    shift = dict(model.success_shift)
    return {
        scale: sqrt(model.stability) * trait
        + sqrt(1.0 - model.stability) * rng.standard_normal()
        + shift.get(f"{questionnaire.original}.{scale}", 0.0) * (success - 0.5)
        for scale, trait in traits.items()
    }


def _on_scale(
    form: Likert | Slider,
    trait: float,
    size: int,
    model: AnswerModel,
    rng: np.random.Generator,
    *,
    backwards: bool,
) -> int:
    """One answer on a scale of ``size`` items that follow the trait."""
    step = form.step if isinstance(form, Slider) else 1
    points = (form.high - form.low) // step + 1
    loading = _loading(points, model.span, size, model.reliability)
    seen = loading * trait + sqrt(1.0 - loading**2) * rng.standard_normal()
    value = form.low + step * bisect_left(_thresholds(points, model.span), seen)
    return form.low + form.high - value if backwards else value


@cache
def _thresholds(points: int, span: float) -> tuple[float, ...]:
    """Where a trait seen with noise is cut into ``points``."""
    return tuple(float(cut) for cut in np.linspace(-span, span, points - 1))


@cache
def _loading(points: int, span: float, size: int, reliability: float) -> float:
    """The loading that gives ``size`` items the reliability, by Spearman-Brown.

    Cutting into points weakens the correlation of two items by the square of that between an
    answer and what it was cut from (exact in the limit of weak correlations).
    """
    between_items = reliability / (size - reliability * (size - 1))
    thresholds = _thresholds(points, span)
    shares = np.diff(ndtr(thresholds), prepend=0.0, append=1.0)
    values = np.arange(points)
    variance = float(shares @ values**2 - (shares @ values) ** 2)
    kept = sum(exp(-0.5 * cut * cut) for cut in thresholds) ** 2 / (2.0 * pi * variance)
    return sqrt(min(between_items / kept, 1.0))
