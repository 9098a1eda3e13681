"""Do conditions differ at all? Friedman's test, Cochran's Q and repeated-measures ANOVA."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, f, rankdata

from steerlab.analysis.statistics.attainable import by_ranks
from steerlab.analysis.statistics.bootstrap import (
    RESAMPLES,
    percentile_interval,
    resample_counts,
)
from steerlab.analysis.statistics.noncentral import explained_interval
from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked_confidence,
    checked_success,
    checked_table,
    too_few,
)
from steerlab.sim.arrays import FloatArray

_ROUNDING = 1e-20  # of all squares: an error term below it is rounding


@dataclass(frozen=True, kw_only=True, slots=True)
class RankedConditions:
    """Conditions compared by their ranks within each person.

    Attributes:
        statistic: Friedman's chi², or Cochran's Q.
        freedom: conditions - 1; ``p`` is that of chi².
        w: Kendall's coefficient of concordance, 0 to 1: how much people agree on the order.
        interval: of w, percentiles over resampled people. Chance alone makes w positive, so it
            does not reach 0.
        smallest_p: that there can be, if all orders of each person's ranks are counted. chi² may
            give a smaller one: of so few people it is no approximation.
    """

    test: str
    statistic: float
    freedom: int
    p: float
    w: float
    interval: ConfidenceInterval | NotComputable
    people: int
    conditions: int
    smallest_p: float


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
    interval: ConfidenceInterval
    generalized_eta2: float
    people: int
    conditions: int


def friedman(
    table: FloatArray,
    *,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> RankedConditions | NotComputable:
    """Friedman's test of ``table`` (people, conditions), corrected for ties.

    R's ``friedman.test``. Two conditions are enough, which ``scipy.stats.friedmanchisquare``
    refuses.

    Raises:
        InvalidConfig: no such table, a value is not finite, or ``resamples`` or ``confidence`` is
            outside what it may be.
    """
    return _ranked("Friedman", checked_table("table", table), rng, resamples, confidence)


def cochran_q(
    success: FloatArray,
    *,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = 0.95,
) -> RankedConditions | NotComputable:
    """Cochran's Q of ``success`` (people, conditions), 0 or 1: Friedman's test of such values.

    Raises:
        InvalidConfig: a value is neither; else see ``friedman``.
    """
    table = checked_success(checked_table("success", success))
    return _ranked("Cochran's Q", table, rng, resamples, confidence)


def repeated_measures(
    table: FloatArray, *, confidence: float = 0.95
) -> RepeatedMeasures | NotComputable:
    """One-way repeated-measures ANOVA of ``table`` (people, conditions), complete.

    R's ``aov(y ~ condition + Error(person/condition))`` with Greenhouse & Geisser's epsilon as in
    ``car::Anova``. The correction is always made: a test of sphericity first would choose a test
    by the data.

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
    covariance = residual.T @ residual
    epsilon = float(np.trace(covariance) ** 2 / np.square(covariance).sum()) / freedom[0]
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


def _ranked(
    test: str, table: FloatArray, rng: np.random.Generator, resamples: int, confidence: float
) -> RankedConditions | NotComputable:
    checked_confidence(confidence)
    people, conditions = table.shape
    if missing := too_few(people):
        return missing
    ranks = rankdata(table, axis=1) - (conditions + 1) / 2.0
    within = np.square(ranks).sum(axis=1)  # what each person's ranks spread; less with ties
    if not within.any():
        return NotComputable(reason="nobody ranks one condition above another")
    counts = resample_counts(people, resamples, rng)
    spread = counts @ within
    if spread.all():
        resampled = np.square(counts @ ranks).sum(axis=1) / spread / people
        interval = percentile_interval(resampled, confidence)
    else:
        some = int(np.count_nonzero(within))
        interval = NotComputable(
            reason=f"only {some} of {people} people rank conditions apart, and resamples miss them"
        )
    w = float(np.square(ranks.sum(axis=0)).sum() / within.sum()) / people
    statistic = w * people * (conditions - 1)
    return RankedConditions(
        test=test,
        statistic=statistic,
        freedom=conditions - 1,
        p=float(chi2.sf(statistic, conditions - 1)),
        w=w,
        interval=interval,
        people=people,
        conditions=conditions,
        smallest_p=by_ranks(ranks),
    )
