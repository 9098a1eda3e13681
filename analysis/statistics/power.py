"""What a sample can find: power of correlations, people needed, smallest correlation found."""

from math import atanh, sqrt

from scipy.optimize import root_scalar
from scipy.stats import norm, t

from steerlab.sim.errors import InvalidConfig

FEWEST = 4
_MOST = 10**7


def correlation_power(r: float, n: int, *, alpha: float = 0.05) -> float:
    """Chance that a two-sided test of ``n`` people rejects when the true correlation is ``r``.

    Cohen's (1988, section 12.7): Fisher's z with the critical r from t; R's ``pwr::pwr.r.test``.
    With an observed r this is only the p-value in other words (Hoenig & Heisey 2001); give the
    effect that the study was planned for.

    Raises:
        InvalidConfig: ``r`` is not within -1 to 1, ``n`` below 4, or ``alpha`` no level.
    """
    _checked_alpha(alpha)
    if not -1.0 < r < 1.0:
        raise InvalidConfig(f"r is {r}; it must be between -1 and 1.")
    if n < FEWEST:
        raise InvalidConfig(f"n is {n}; a correlation needs at least {FEWEST} people.")
    return _power(abs(r), n, alpha)


def people_needed(r: float, *, power: float = 0.8, alpha: float = 0.05) -> int:
    """The fewest people with whom a true correlation ``r`` is found with chance ``power``.

    Raises:
        InvalidConfig: ``r`` is 0 or not within -1 to 1, or too small for any study.
    """
    _checked_alpha(alpha)
    _checked_power(power, alpha)
    if not 0.0 < abs(r) < 1.0:
        raise InvalidConfig(f"r is {r}; it must be between -1 and 1, and not 0.")
    if _power(abs(r), _MOST, alpha) < power:
        raise InvalidConfig(f"r is {r}; {_MOST} people would not suffice to find it.")
    low, high = FEWEST - 1, _MOST
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _power(abs(r), middle, alpha) >= power else (middle, high)
    return high


def smallest_correlation(n: int, *, power: float = 0.8, alpha: float = 0.05) -> float:
    """The smallest true |r| that ``n`` people find with chance ``power``.

    Raises:
        InvalidConfig: ``n`` below 4, or ``power`` or ``alpha`` no level.
    """
    _checked_alpha(alpha)
    _checked_power(power, alpha)
    if n < FEWEST:
        raise InvalidConfig(f"n is {n}; a correlation needs at least {FEWEST} people.")
    found = root_scalar(
        lambda r: _power(r, n, alpha) - power, bracket=(0.0, 1.0 - 1e-12), xtol=1e-12
    )
    return float(found.root)


def _power(r: float, n: int, alpha: float) -> float:
    critical_t = float(t.isf(alpha / 2.0, n - 2))
    critical = atanh(critical_t / sqrt(critical_t**2 + n - 2))
    expected = atanh(r) + r / (2.0 * (n - 1))
    scale = sqrt(n - 3)
    return float(norm.cdf((expected - critical) * scale) + norm.cdf((-expected - critical) * scale))


def _checked_alpha(alpha: float) -> None:
    if not 0.0 < alpha < 1.0:
        raise InvalidConfig(f"alpha is {alpha}; it must be between 0 and 1.")


def _checked_power(power: float, alpha: float) -> None:
    if not alpha < power < 1.0:
        raise InvalidConfig(f"power is {power}; it must lie between alpha ({alpha}) and 1.")
