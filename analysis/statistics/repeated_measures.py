"""Conditions within people by means: repeated-measures ANOVA with Greenhouse & Geisser's epsilon."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f

from steerlab.analysis.statistics.noncentral import explained_interval
from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked_confidence,
    checked_table,
    too_few,
)
from steerlab.sim.rollout import FloatArray

_ROUNDING = 1e-20  # of all squares: an error term below it is rounding


@dataclass(frozen=True, kw_only=True, slots=True)
class RepeatedMeasures:
    """Condition means compared within people.

    Attributes:
        statistic: F.
        freedom: conditions - 1 and (conditions - 1)(people - 1), before ``epsilon``.
        epsilon: 1 where all differences between conditions vary alike, at least 1/(conditions - 1).
        p: with both degrees of freedom times epsilon; ``p_uncorrected`` without.
        partial_eta2: share of the variance within people that conditions explain.
        interval: of it, from the noncentral F with the corrected degrees of freedom.
        generalized_eta2: share of all variance, comparable with studies between people (Olejnik &
            Algina 2003).
    """

    statistic: float
    freedom: tuple[int, int]
    epsilon: float
    p: float
    p_uncorrected: float
    partial_eta2: float
    interval: Interval
    generalized_eta2: float
    people: int
    conditions: int


def repeated_measures(
    table: FloatArray, *, confidence: float = 0.95
) -> RepeatedMeasures | NotComputable:
    """One-way repeated-measures ANOVA of ``table`` (people, conditions), complete.

    R's ``aov(y ~ condition + Error(person/condition))`` with epsilon as in ``car::Anova``. The
    correction is always made: a test of sphericity first would choose a test by the data.

    Raises:
        InvalidConfig: no such table, a value is not finite, or ``confidence`` is no level.
    """
    table = checked_table("table", table)
    checked_confidence(confidence)
    people, conditions = table.shape
    if missing := too_few(people):
        return missing
    centred = table - table.mean()
    of_people = centred.mean(axis=1, keepdims=True)
    of_conditions = centred.mean(axis=0)
    residual = centred - of_people - of_conditions
    between = people * float(np.square(of_conditions).sum())
    error = float(np.square(residual).sum())
    subjects = conditions * float(np.square(of_people).sum())
    if error <= _ROUNDING * np.square(table).sum():
        return NotComputable(
            reason="conditions differ alike for everyone, so chance has no measure"
        )
    freedom = (conditions - 1, (conditions - 1) * (people - 1))
    statistic = (between / freedom[0]) / (error / freedom[1])
    epsilon = _epsilon(residual)
    corrected = (epsilon * freedom[0], epsilon * freedom[1])
    return RepeatedMeasures(
        statistic=statistic,
        freedom=freedom,
        epsilon=epsilon,
        p=float(f.sf(statistic, *corrected)),
        p_uncorrected=float(f.sf(statistic, *freedom)),
        partial_eta2=between / (between + error),
        interval=explained_interval(
            statistic, *corrected, n=sum(corrected) + 1.0, confidence=confidence
        ),
        generalized_eta2=between / (between + error + subjects),
        people=people,
        conditions=conditions,
    )


def _epsilon(residual: FloatArray) -> float:
    """Greenhouse & Geisser's, from the double-centred residuals (people, conditions)."""
    covariance = residual.T @ residual
    return float(np.trace(covariance) ** 2 / np.square(covariance).sum()) / (residual.shape[1] - 1)
