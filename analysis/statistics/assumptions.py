"""Are data normal, and is their spread the same everywhere? The paper's two checks."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, shapiro

from steerlab.analysis.statistics.outcome import (
    NotComputable,
    checked,
    checked_pairs,
    flat,
    too_few,
)
from steerlab.sim.rollout import FloatArray

MOST_FOR_SHAPIRO = 5000  # Royston's p-value (AS R94, 1995) was fitted up to here
_EXACT_FIT = 1e-20  # of the variance of y: what a line leaves of itself is rounding


@dataclass(frozen=True, kw_only=True, slots=True)
class AssumptionCheck:
    """One test of an assumption; a small ``p`` speaks against it.

    Attributes:
        test: its name.
        statistic: W of Shapiro-Wilk, chi² with one degree of freedom of the score test.
    """

    test: str
    statistic: float
    p: float
    n: int


def shapiro_wilk(values: FloatArray) -> AssumptionCheck | NotComputable:
    """Shapiro-Wilk's test of normality, R's ``shapiro.test``; ``values`` (n,).

    Raises:
        InvalidConfig: a value is not finite.
    """
    values = checked("values", values)
    if missing := too_few(len(values)) or flat("the sample", values):
        return missing
    if len(values) > MOST_FOR_SHAPIRO:
        return NotComputable(
            reason=f"{len(values)} values; Shapiro-Wilk's p-value holds to {MOST_FOR_SHAPIRO}"
        )
    values = values - values.mean()
    values = values / np.abs(values).max()  # W knows no unit, but scipy calls a tiny range none
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = shapiro(values)
    return AssumptionCheck(
        test="Shapiro-Wilk", statistic=float(found.statistic), p=float(found.pvalue), n=len(values)
    )


def score_test(x: FloatArray, y: FloatArray) -> AssumptionCheck | NotComputable:
    """Non-constant variance score test of the line ``y ~ x`` over its fitted values.

    Breusch & Pagan (1979), Cook & Weisberg (1983); R's ``car::ncvTest(lm(y ~ x))``, statsmodels'
    ``het_breuschpagan(residuals, [1, fitted], robust=False)``. Its default, ``robust=True``, is
    Koenker's, another test.

    Raises:
        InvalidConfig: lengths differ or a value is not finite.
    """
    x, y = checked_pairs(x, y)
    if missing := too_few(len(x)) or flat("x", x) or flat("y", y):
        return missing
    centred = (x - x.mean()) / x.std()
    slope = centred @ y / len(x)
    residual = y - y.mean() - slope * centred
    if residual @ residual <= _EXACT_FIT * np.square(y - y.mean()).sum():
        return NotComputable(reason="y lies on a line, so no residual has a spread")
    # Fitted values are a line in x, so scaled squares regressed on either explain the same.
    squares = residual**2 / np.mean(residual**2)
    if slope**2 <= _EXACT_FIT * y.var():
        return NotComputable(reason="the fitted line is level, so all fitted values are one")
    statistic = float((centred @ squares) ** 2 / (2.0 * len(x)))
    return AssumptionCheck(
        test="non-constant variance score",
        statistic=statistic,
        p=float(chi2.sf(statistic, 1)),
        n=len(x),
    )
