"""A mixed model with an intercept a person: conditions compared although order matters too."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from scipy.optimize import fminbound
from scipy.special import stdtr, stdtrit
from scipy.stats import f

from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked,
    checked_confidence,
    too_few,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_ROUNDING = 1e-20  # of the squares of y: residuals below it are rounding
_STEP = 1e-10  # of the share of variance that is between people


@dataclass(frozen=True, kw_only=True, slots=True)
class Coefficient:
    """One fixed effect; ``p`` is two-sided, by t with ``freedom`` degrees of freedom."""

    name: str
    estimate: float
    error: float
    t: float
    freedom: int
    p: float
    interval: ConfidenceInterval


class WaldF(NamedTuple):
    """A joint test of several coefficients: ``f`` with its degrees of freedom."""

    f: float
    between: int
    within: int
    p: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class MixedModel:
    """Fixed effects beside a random intercept of each person, fitted by REML.

    Attributes:
        coefficients: in the order of the columns, the intercept first.
        covariance: of their estimates, (coefficients, coefficients).
        person_sd: how people differ; 0 where the data show no more than chance.
        residual_sd: what is left.
    """

    coefficients: tuple[Coefficient, ...]
    covariance: FloatArray
    person_sd: float
    residual_sd: float
    people: int
    rows: int

    def joint_test(self, names: Sequence[str]) -> WaldF:
        """Wald's F that the named coefficients are all 0.

        Raises:
            InvalidConfig: a name is unknown.
        """
        known = [coefficient.name for coefficient in self.coefficients]
        if unknown := [name for name in names if name not in known]:
            raise InvalidConfig(f"No coefficient {unknown[0]!r}; choose from {known}.")
        at = [known.index(name) for name in names]
        estimate = np.array([self.coefficients[index].estimate for index in at])
        statistic = float(estimate @ np.linalg.solve(self.covariance[np.ix_(at, at)], estimate))
        statistic /= len(at)
        freedom = self.coefficients[at[0]].freedom
        p = float(f.sf(statistic, len(at), freedom))
        return WaldF(f=statistic, between=len(at), within=freedom, p=p)


def mixed_model(
    y: FloatArray,
    columns: dict[str, FloatArray],
    person: FloatArray,
    *,
    confidence: float = 0.95,
) -> MixedModel | NotComputable:
    """Fit ``y ~ columns`` with a random intercept a person, by REML as R's ``lme4::lmer``.

    statsmodels' ``MixedLM`` is no substitute: its standard errors are not those of lmer where rows
    are missing, and where people do not differ it fails to converge (``docs/statistics.md``).

    lmer gives no p-values. Here t has rows - people - columns degrees of freedom, those of
    ``nlme::lme`` for what varies within people; use no columns that are constant within them.

    Args:
        y: (rows,).
        columns: (rows,) each, by name, without the intercept; of a factor all levels but one.
        person: (rows,) who each row is of. People may lack rows.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``confidence`` is no level.
    """
    y, person = checked("y", y), checked("person", person)
    checked_confidence(confidence)
    wrong = [name for name, column in columns.items() if len(column) != len(y)]
    if wrong or len(person) != len(y):
        raise InvalidConfig(f"y has {len(y)} rows; {wrong or 'person'} has another number.")
    rows = np.column_stack([np.ones(len(y)), *(checked(*column) for column in columns.items()), y])
    people, group = np.unique(person, return_inverse=True)
    freedom = len(y) - len(people) - len(columns)
    if missing := too_few(len(people)):
        return missing
    of_person = (group == np.arange(len(people))[:, None]).astype(np.float64)  # (people, rows)
    sums, sizes = of_person @ rows, of_person.sum(axis=1)
    within = rows - (sums / sizes[:, None])[group]
    effects, _, rank, _ = np.linalg.lstsq(within[:, 1:-1], within[:, -1], rcond=None)
    if freedom < 1 or rank < len(columns):
        return NotComputable(reason=f"{len(y)} rows do not tell {', '.join(columns)} apart")
    left = within[:, -1] - within[:, 1:-1] @ effects
    if left @ left <= _ROUNDING * float(y @ y):
        return NotComputable(reason="people and the fixed effects explain everything")
    products = rows.T @ rows

    def deviance(share: float) -> float:
        """REML's, where ``share`` of the variance is between people, 0 to below 1."""
        ratio = share / (1.0 - share)
        information, _, residual = _least_squares(products, sums, sizes, ratio)
        return (
            float(np.log1p(ratio * sizes).sum())
            + float(np.linalg.slogdet(information)[1])
            + (len(y) - len(information)) * log(max(residual, np.finfo(float).tiny))
        )

    best = fminbound(deviance, 0.0, 1.0 - _STEP, xtol=_STEP, maxfun=1000)
    share = min(0.0, float(np.asarray(best)), key=deviance)  # fminbound never tries 0 itself
    ratio = share / (1.0 - share)
    information, beta, residual = _least_squares(products, sums, sizes, ratio)
    variance = residual / (len(y) - len(beta))
    covariance = np.asarray(variance * np.linalg.inv(information), dtype=np.float64)
    return MixedModel(
        coefficients=tuple(
            _coefficient(name, float(estimate), sqrt(square), freedom, confidence)
            for name, estimate, square in zip(
                ("intercept", *columns), beta, np.diag(covariance), strict=True
            )
        ),
        covariance=covariance,
        person_sd=sqrt(variance * ratio),
        residual_sd=sqrt(variance),
        people=len(people),
        rows=len(y),
    )


def _least_squares(
    products: FloatArray, sums: FloatArray, sizes: FloatArray, ratio: float
) -> tuple[FloatArray, FloatArray, float]:
    """Generalized least squares where people vary ``ratio`` times as much as residuals.

    A person's inverse covariance is I - ratio / (1 + ratio n) 11', so sums a person suffice.

    Args:
        products: of each two columns of the design and y, (columns + 1, columns + 1).
        sums: of these columns over each person's rows, (people, columns + 1).
        sizes: rows of each person, (people,).

    Returns:
        The design's information (columns, columns), the coefficients (columns,) and the sum of
        squares that they leave.
    """
    weights = ratio / (1.0 + ratio * sizes)
    whitened = products - sums.T @ (weights[:, None] * sums)
    information, with_y = whitened[:-1, :-1], whitened[:-1, -1]
    beta = np.asarray(np.linalg.solve(information, with_y), dtype=np.float64)
    return information, beta, float(whitened[-1, -1] - with_y @ beta)


def _coefficient(
    name: str, estimate: float, error: float, freedom: int, confidence: float
) -> Coefficient:
    half = float(stdtrit(freedom, 0.5 + confidence / 2.0)) * error
    return Coefficient(
        name=name,
        estimate=estimate,
        error=error,
        t=estimate / error,
        freedom=freedom,
        p=2.0 * float(stdtr(freedom, -abs(estimate / error))),
        interval=ConfidenceInterval(
            low=estimate - half, high=estimate + half, confidence=confidence
        ),
    )
