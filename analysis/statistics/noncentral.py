"""The noncentral F distribution: intervals of explained variance, and what a sample could find."""

from math import isinf, sqrt

from scipy.optimize import root_scalar
from scipy.stats import f, ncf

from steerlab.analysis.statistics.outcome import ConfidenceInterval
from steerlab.sim.errors import InvalidConfig


def explained_interval(
    statistic: float, between: float, within: float, *, n: float, confidence: float
) -> ConfidenceInterval:
    """Interval of the share of variance explained, lambda / (lambda + n), 0 to 1.

    The noncentralities lambda under which an F as large, or as small, as ``statistic`` has half of
    1 - confidence (Steiger & Fouladi 1997). The design counts as fixed.

    Args:
        statistic: F; infinite where everything is explained.
        between, within: its degrees of freedom.
        n: observations; for a partial share, both degrees of freedom and 1.
    """
    if isinf(statistic):
        return ConfidenceInterval(low=1.0, high=1.0, confidence=confidence)
    tail = (1.0 - confidence) / 2.0
    low = _noncentrality(statistic, between, within, 1.0 - tail)
    high = _noncentrality(statistic, between, within, tail)
    return ConfidenceInterval(low=low / (low + n), high=high / (high + n), confidence=confidence)


def multiple_power(r: float, n: int, dimensions: int, *, alpha: float = 0.05) -> float:
    """Chance that the F test of a multiple R rejects when the true one is ``r``.

    Cohen (1988), section 9.3, with noncentrality n r² / (1 - r²) for the embeddings that the people
    have; R's ``pwr::pwr.f2.test`` with n - dimensions - 1 degrees of freedom.

    Raises:
        InvalidConfig: ``r`` is not from 0 to below 1, or too few people.
    """
    if not 0.0 <= r < 1.0:
        raise InvalidConfig(f"r is {r}; a multiple R is from 0 to below 1.")
    within = _freedom_within(n, dimensions)
    return _power(n * r * r / (1.0 - r * r), dimensions, within, alpha)


def smallest_multiple(n: int, dimensions: int, *, power: float = 0.8, alpha: float = 0.05) -> float:
    """The smallest true multiple R that ``n`` people find with chance ``power``.

    Raises:
        InvalidConfig: too few people, or ``power`` is not between alpha and 1.
    """
    noncentrality = _noncentrality_with(power, dimensions, _freedom_within(n, dimensions), alpha)
    return sqrt(noncentrality / (noncentrality + n))


def paired_power(d: float, n: float, *, alpha: float = 0.05) -> float:
    """Chance that a two-sided paired t test rejects a true mean difference of ``d`` of its SDs.

    t² is F with 1 and n - 1 degrees of freedom (scipy's noncentral t is NaN in far tails); R's
    ``power.t.test(type = "paired", strict = TRUE)``. ``n`` need not be whole.

    Raises:
        InvalidConfig: fewer than 2 people.
    """
    if n < 2:
        raise InvalidConfig(f"n is {n}; a paired test needs 2 people.")
    return _power(n * d * d, 1, n - 1, alpha)


def _power(noncentrality: float, between: int, within: float, alpha: float) -> float:
    # 1 - cdf, as scipy 1.17's ncf.sf is below 0 for a noncentrality of 0.
    return 1.0 - float(ncf.cdf(f.isf(alpha, between, within), between, within, noncentrality))


def _noncentrality_with(power: float, between: int, within: int, alpha: float) -> float:
    if not alpha < power < 1.0:
        raise InvalidConfig(f"power is {power}; it must lie between alpha ({alpha}) and 1.")
    return _noncentrality(float(f.isf(alpha, between, within)), between, within, 1.0 - power)


def _noncentrality(statistic: float, between: float, within: float, share: float) -> float:
    """Lambda for which the distribution function at ``statistic`` is ``share``; at least 0.

    ``scipy.special.ncfdtrinc`` stops at 10,000 and has two to five digits.
    """
    if f.cdf(statistic, between, within) <= share:
        return 0.0

    def excess(noncentrality: float) -> float:
        return float(ncf.cdf(statistic, between, within, noncentrality)) - share

    top = 1.0 + statistic * between
    while excess(top) > 0.0:
        top *= 2.0
    return float(root_scalar(excess, bracket=(0.0, top), xtol=1e-10, rtol=1e-12).root)


def _freedom_within(n: int, dimensions: int) -> int:
    within = n - dimensions - 1
    if within < 1 or dimensions < 1:
        raise InvalidConfig(f"{n} people and {dimensions} dimensions; more people are needed.")
    return within
