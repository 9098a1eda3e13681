"""Cronbach's alpha with Feldt's confidence interval."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

FEWEST_PEOPLE = 3
FEWEST_ITEMS = 2


@dataclass(frozen=True, kw_only=True, slots=True)
class CronbachAlpha:
    """How consistently the items of a scale measure one thing, in one sample.

    Attributes:
        alpha: None if it is not defined; it may be negative.
        low, high: the confidence interval.
        confidence: its level.
        people: with all answers; those who ``left_out`` any do not count.
        items: that vary among them; ``constant`` ones do not count.
        reason: why there is no alpha; empty if there is one.
    """

    alpha: float | None
    low: float | None
    high: float | None
    confidence: float
    people: int
    left_out: int
    items: int
    constant: int
    reason: str = ""


def cronbach_alpha(answers: FloatArray, *, confidence: float = 0.95) -> CronbachAlpha:
    """Alpha = k/(k-1) · (1 - sum of the items' variances / variance of the sum).

    The interval is Feldt's (Feldt, Woodruff & Salih 1987, Applied Psychological Measurement 11,
    93-103, formulas 6 and 7), as in R's ``psych::alpha.ci`` and ``cocron``. People with a missing
    answer are left out; ``psych::alpha`` would use their pairs of answers. Items that everyone
    answered alike are left out too, as ``psych::alpha`` does with a warning.

    Args:
        answers: keyed, (people, items); NaN where there is none.

    Raises:
        InvalidConfig: ``answers`` is no table, has an infinite value, or ``confidence`` is not
            between 0 and 1.
    """
    if not 0.0 < confidence < 1.0:
        raise InvalidConfig(f"confidence is {confidence}; it must be between 0 and 1.")
    if answers.ndim != 2 or np.isinf(answers).any():
        raise InvalidConfig(
            f"Answers of shape {answers.shape} are no finite table of (people, items)."
        )
    complete = answers[~np.isnan(answers).any(axis=1)]
    people = len(complete)
    reason = _why_undefined(complete)
    if people:
        complete = complete[:, np.ptp(complete, axis=0) > 0.0]
    items = complete.shape[1]
    alpha = low = high = None
    if not reason:
        within = complete.var(axis=0, ddof=1).sum()
        alpha = float(items / (items - 1) * (1.0 - within / complete.sum(axis=1).var(ddof=1)))
        tail = (1.0 - confidence) / 2.0
        freedom = (people - 1, (people - 1) * (items - 1))
        low, high = (
            float(1.0 - (1.0 - alpha) * fdtri(*freedom, share)) for share in (1.0 - tail, tail)
        )
    return CronbachAlpha(
        alpha=alpha,
        low=low,
        high=high,
        confidence=confidence,
        people=people,
        left_out=len(answers) - people,
        items=items,
        constant=answers.shape[1] - items,
        reason=reason,
    )


def _why_undefined(complete: FloatArray) -> str:
    """Why these answers, (people, items) without gaps, have no alpha; empty if they have one."""
    people, items = complete.shape
    if items < FEWEST_ITEMS:
        return f"items: {items}; at least {FEWEST_ITEMS} are needed"
    if people < FEWEST_PEOPLE:
        return f"people with all answers: {people}; at least {FEWEST_PEOPLE} are needed"
    if np.ptp(complete.sum(axis=1)) == 0.0:
        return "everyone has the same score, so nothing varies"
    varying = int((np.ptp(complete, axis=0) > 0.0).sum())
    if varying < FEWEST_ITEMS:
        return f"items that vary: {varying}; at least {FEWEST_ITEMS} are needed"
    return ""
