"""A mixed model with an intercept a person: conditions compared although order matters too."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from scipy.optimize import fminbound
from scipy.stats import f, t

from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked,
    checked_confidence,
    too_few,
)
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

_ROUNDING = 1e-20
_STEP = 1e-10


@dataclass(frozen=True, kw_only=True, slots=True)
class Coefficient:
    """One fixed effect; ``p`` is two-sided, by t with ``freedom`` degrees of freedom."""

    name: str
    estimate: float
    error: float
    t: float
    freedom: int
    p: float
    interval: Interval


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
        known = [one.name for one in self.coefficients]
        if unknown := [name for name in names if name not in known]:
            raise InvalidConfig(f"No coefficient {unknown[0]!r}; choose from {known}.")
        at = [known.index(name) for name in names]
        estimate = np.array([self.coefficients[one].estimate for one in at])
        statistic = float(estimate @ np.linalg.solve(self.covariance[np.ix_(at, at)], estimate))
        statistic /= len(at)
        freedom = self.coefficients[at[0]].freedom
        p = float(f.sf(statistic, len(at), freedom))
        return WaldF(f=statistic, between=len(at), within=freedom, p=p)


class _Fit(NamedTuple):
    deviance: float
    beta: FloatArray
    information: FloatArray
    residual: float


def mixed_model(
    y: FloatArray,
    columns: dict[str, FloatArray],
    person: FloatArray,
    *,
    confidence: float = 0.95,
) -> MixedModel | NotComputable:
    """Fit ``y ~ columns`` with a random intercept a person, by REML as R's ``lme4::lmer``.

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
    names = ("intercept", *columns)
    design = np.column_stack([np.ones(len(y)), *(checked(k, v) for k, v in columns.items())])
    people, group = np.unique(person, return_inverse=True)
    freedom = len(y) - len(people) - len(columns)
    if missing := too_few(len(people)):
        return missing
    data = np.column_stack([design, y])
    within = data - _group_means(data, group, len(people))[group]
    if freedom < 1 or np.linalg.matrix_rank(within[:, 1:-1]) < len(columns):
        return NotComputable(reason=f"{len(y)} rows do not tell {', '.join(columns)} apart")
    explained = np.linalg.lstsq(within[:, 1:-1], within[:, -1], rcond=None)[0]
    left = within[:, -1] - within[:, 1:-1] @ explained
    if left @ left <= _ROUNDING * float(y @ y):
        return NotComputable(reason="people and the fixed effects explain everything")
    sums = _group_sums(data, group, len(people))
    sizes = np.bincount(group).astype(np.float64)
    products = data.T @ data

    def fit(share: float) -> _Fit:
        return _fit(products, sums, sizes, share / (1.0 - share))

    found = fminbound(lambda share: fit(share).deviance, 0.0, 1.0 - _STEP, xtol=_STEP, maxfun=1000)
    share = float(np.asarray(found))
    share = share if fit(share).deviance < fit(0.0).deviance else 0.0
    best = fit(share)
    variance = best.residual / (len(y) - len(names))
    covariance = np.asarray(variance * np.linalg.inv(best.information), dtype=np.float64)
    return MixedModel(
        coefficients=_coefficients(names, best.beta, covariance, freedom, confidence),
        covariance=covariance,
        person_sd=sqrt(variance * share / (1.0 - share)),
        residual_sd=sqrt(variance),
        people=len(people),
        rows=len(y),
    )


def _fit(products: FloatArray, sums: FloatArray, sizes: FloatArray, ratio: float) -> _Fit:
    """Generalized least squares where people vary ``ratio`` times as much as residuals.

    A person's inverse covariance is I - ratio / (1 + ratio n) 11', so sums a person suffice.
    """
    weights = ratio / (1.0 + ratio * sizes)
    whitened = products - sums.T @ (weights[:, None] * sums)
    information, with_y = whitened[:-1, :-1], whitened[:-1, -1]
    beta = np.asarray(np.linalg.solve(information, with_y), dtype=np.float64)
    residual = float(whitened[-1, -1] - with_y @ beta)
    freedom = sizes.sum() - len(beta)
    deviance = (
        float(np.log1p(ratio * sizes).sum())
        + float(np.linalg.slogdet(information)[1])
        + freedom * log(max(residual, np.finfo(float).tiny))
    )
    return _Fit(deviance=deviance, beta=beta, information=information, residual=residual)


def _coefficients(
    names: Sequence[str],
    beta: FloatArray,
    covariance: FloatArray,
    freedom: int,
    confidence: float,
) -> tuple[Coefficient, ...]:
    width = float(t.ppf(0.5 + confidence / 2.0, freedom))
    made: list[Coefficient] = []
    for at, name in enumerate(names):
        estimate, error = float(beta[at]), sqrt(covariance[at, at])
        made.append(
            Coefficient(
                name=name,
                estimate=estimate,
                error=error,
                t=estimate / error,
                freedom=freedom,
                p=float(2.0 * t.sf(abs(estimate / error), freedom)),
                interval=Interval(
                    low=estimate - width * error,
                    high=estimate + width * error,
                    confidence=confidence,
                ),
            )
        )
    return tuple(made)


def _group_sums(columns: FloatArray, group: np.ndarray, groups: int) -> FloatArray:
    sums = np.zeros((groups, columns.shape[1]))
    np.add.at(sums, group, columns)
    return sums


def _group_means(columns: FloatArray, group: np.ndarray, groups: int) -> FloatArray:
    return _group_sums(columns, group, groups) / np.bincount(group, minlength=groups)[:, None]
