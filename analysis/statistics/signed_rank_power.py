"""What Wilcoxon's signed-rank test can find: by simulation for few people, by its efficiency for many.

A t test's power is no stand-in: with five people it has some for a large effect, and Wilcoxon's test,
whose smallest p is then .0625, has none.
"""

from functools import lru_cache
from math import pi

import numpy as np

from steerlab.analysis.statistics.attainable import by_signs
from steerlab.analysis.statistics.noncentral import paired_power
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import MOST_EXACT, signed_rank_shares
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

STUDIES = 20_000
"""Simulated ones; the Monte-Carlo error of a power of one half is 0.35 %."""
_EFFICIENCY = 3.0 / pi  # of the t test's, for normal differences (Lehmann, Nonparametrics, 1975)
_LARGEST, _HALVINGS = 8.0, 12  # standard deviations; to 0.002 of them


def signed_rank_power(d: float, n: int, *, alpha: float = 0.05, seed: int = 0) -> float:
    """Chance that Wilcoxon's test of ``n`` normal differences with mean ``d`` SDs gives p < alpha.

    Up to ``MOST_EXACT`` people by ``STUDIES`` simulated studies and the test's exact distribution;
    beyond, the t test's with 3 / pi as many people.

    Args:
        seed: of the simulated studies; one seed draws the same for every ``d``.

    Raises:
        InvalidConfig: fewer than 2 people.
    """
    if n < 2:
        raise InvalidConfig(f"n is {n}; a paired test needs 2 people.")
    if n > MOST_EXACT:
        return paired_power(d, n * _EFFICIENCY, alpha=alpha)
    largest = int((2.0 * np.cumsum(signed_rank_shares(n)) < alpha).sum()) - 1
    if largest < 0:
        return 0.0
    differences = _noise(n, seed) + d
    order = np.argsort(np.abs(differences), axis=1)
    positive = np.take_along_axis(differences > 0.0, order, axis=1)
    v = positive @ np.arange(1.0, n + 1.0)
    return float(np.mean((v <= largest) | (v >= n * (n + 1) // 2 - largest)))


@lru_cache(maxsize=256)
def smallest_signed_rank(
    n: int, *, power: float = 0.8, alpha: float = 0.05, seed: int = 0
) -> float | NotComputable:
    """The smallest mean difference, in SDs, that ``n`` people find with chance ``power``.

    Raises:
        InvalidConfig: fewer than 2 people, or ``power`` is not between alpha and 1.
    """
    if not alpha < power < 1.0:
        raise InvalidConfig(f"power is {power}; it must lie between alpha ({alpha}) and 1.")
    if n >= 2 and by_signs(n) >= alpha:
        return NotComputable(reason=f"with {n} people no difference is large enough")
    low, high = 0.0, _LARGEST
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        if signed_rank_power(middle, n, alpha=alpha, seed=seed) < power:
            low = middle
        else:
            high = middle
    return high


@lru_cache(maxsize=2)
def _noise(n: int, seed: int) -> FloatArray:
    """Standard normal differences, (STUDIES, n)."""
    return np.random.default_rng([seed, n]).standard_normal((STUDIES, n))
