"""What a sample could find beside plain correlations: multiple R, and paired differences."""

from math import sqrt

from scipy.optimize import root_scalar
from scipy.stats import f, ncf, nct, t

from steerlab.sim.errors import InvalidConfig

_MOST_EFFECT = 20.0


def multiple_power(r: float, n: int, dimensions: int, *, alpha: float = 0.05) -> float:
    """Chance that the F test of a multiple R rejects when the true one is ``r``.

    Cohen (1988), section 9.3, with noncentrality n r² / (1 - r²) for the embeddings that the people
    have; R's ``pwr::pwr.f2.test`` with n - dimensions - 1 degrees of freedom.

    Raises:
        InvalidConfig: ``r`` is not from 0 to below 1, or too few people.
    """
    if not 0.0 <= r < 1.0:
        raise InvalidConfig(f"r is {r}; a multiple R is from 0 to below 1.")
    within = n - dimensions - 1
    if within < 1 or dimensions < 1:
        raise InvalidConfig(f"{n} people and {dimensions} dimensions; more people are needed.")
    critical = float(f.isf(alpha, dimensions, within))
    if r == 0.0:
        return alpha
    return float(ncf.sf(critical, dimensions, within, n * r * r / (1.0 - r * r)))


def smallest_multiple(n: int, dimensions: int, *, power: float = 0.8, alpha: float = 0.05) -> float:
    """The smallest true multiple R that ``n`` people find with chance ``power``.

    Raises:
        InvalidConfig: too few people, or ``power`` is not between alpha and 1.
    """
    _check_power(power, alpha)
    multiple_power(0.0, n, dimensions, alpha=alpha)
    found = root_scalar(
        lambda r: multiple_power(r, n, dimensions, alpha=alpha) - power,
        bracket=(1e-6, 1.0 - 1e-9),
        xtol=1e-9,
    )
    return float(found.root)


def paired_power(d: float, n: int, *, alpha: float = 0.05) -> float:
    """Chance that a two-sided paired t test rejects a true mean difference of ``d`` of its SDs.

    Noncentral t, R's ``power.t.test(type = "paired", strict = TRUE)``. Wilcoxon's test has 95 % of
    its efficiency for normal differences, and more for heavy tails.

    Raises:
        InvalidConfig: fewer than 2 people.
    """
    if n < 2:
        raise InvalidConfig(f"n is {n}; a paired test needs 2 people.")
    critical, shift = float(t.isf(alpha / 2.0, n - 1)), d * sqrt(n)
    return float(nct.sf(critical, n - 1, shift) + nct.cdf(-critical, n - 1, shift))


def smallest_paired(n: int, *, power: float = 0.8, alpha: float = 0.05) -> float:
    """The smallest true difference, in its SDs, that ``n`` people find with chance ``power``.

    Raises:
        InvalidConfig: fewer than 2 people, or ``power`` is not between alpha and 1.
    """
    _check_power(power, alpha)
    top = 1.0
    while paired_power(top, n, alpha=alpha) < power and top < _MOST_EFFECT:
        top *= 2.0
    found = root_scalar(
        lambda d: paired_power(d, n, alpha=alpha) - power, bracket=(0.0, top), xtol=1e-9
    )
    return float(found.root)


def _check_power(power: float, alpha: float) -> None:
    if not alpha < power < 1.0:
        raise InvalidConfig(f"power is {power}; it must lie between alpha ({alpha}) and 1.")
