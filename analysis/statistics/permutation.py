"""Permutation p-values."""

import numpy as np

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

PERMUTATIONS = 9999
_ROUNDING = 1e-10  # relative: equal statistics of two orders differ by rounding


def permuted(values: FloatArray, permutations: int, rng: np.random.Generator) -> FloatArray:
    """``values`` (n,) in random orders, (permutations, n).

    Raises:
        InvalidConfig: fewer than 19 permutations, with which no p-value reaches 5 %.
    """
    if permutations < 19:
        raise InvalidConfig(f"permutations is {permutations}; fewer than 19 cannot reach 5 %.")
    return rng.permuted(np.broadcast_to(values, (permutations, len(values))), axis=1)


def permutation_p(observed: float, of_chance: FloatArray) -> float:
    """Share of statistics at least as large, the observed one among them, so never 0.

    Phipson & Smyth, Statistical Applications in Genetics and Molecular Biology 9, 2010.
    """
    as_large = int((of_chance >= observed - _ROUNDING * abs(observed)).sum())
    return (1 + as_large) / (1 + len(of_chance))
