"""The smallest p-value that a test can give at all. With few people it may lie above any alpha.

A test on ranks, signs or permuted orders has as many outcomes as there are arrangements of its data.
If the smallest p of all of them is not below alpha, the test was decided before anybody was seen:
nothing was tested. Each bound depends on how many people and ties there are, never on which way they
point, so that leaving such a test out of a family costs the correction nothing (Tarone, Biometrics
46, 515-522, 1990).
"""

from math import comb, factorial, prod

import numpy as np

from steerlab.sim.arrays import FloatArray


def by_signs(differing: int) -> float:
    """Two-sided, of ``differing`` signs that are each as likely as not: Wilcoxon's and McNemar's."""
    return min(1.0, 2.0 ** (1 - differing))


def by_orders(values: FloatArray, permutations: int) -> float:
    """Of random orders of ``values`` (n,): the order itself counts, and 1 / n! of all orders are it.

    Equal values make fewer orders.
    """
    return max(1.0 / (1 + permutations), 1 / _orders(values))


def by_groups(first: int, second: int, permutations: int) -> float:
    """Of who is in which of two groups. Groups of one size can be exchanged: that is one outcome."""
    alike = 2 if first == second else 1
    return max(1.0 / (1 + permutations), alike / comb(first + second, first))


def by_ranks(ranks: FloatArray) -> float:
    """Of each person's ranks (people, conditions) in any order: Friedman's and Cochran's.

    Reordering conditions for everyone alike changes nothing, so the most extreme outcome comes as
    often as the person with most orders has orders.
    """
    orders = [_orders(row) for row in ranks]
    return min(1.0, max(orders) / prod(orders))


def _orders(values: FloatArray) -> int:
    """In how many orders ``values`` (n,) come that can be told apart; exact, however many."""
    repeats = np.unique(values, return_counts=True)[1].tolist()
    return factorial(len(values)) // prod(map(factorial, repeats))
