"""The smallest p-values that tests can give: of all outcomes there are, none has a smaller one."""

from itertools import combinations, permutations, product

import numpy as np
import pytest

from steerlab.analysis.statistics.attainable import by_groups, by_orders, by_ranks, by_signs
from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.multiple_correlation import basis_of, explained_by
from steerlab.analysis.statistics.omnibus import friedman
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import all_pairs, mcnemar, wilcoxon


@pytest.mark.parametrize("n", [4, 5, 6, 9])
def test_wilcoxons_and_mcnemars_is_reached_when_all_point_one_way(n):
    rising = np.arange(1.0, n + 1.0)
    found = wilcoxon(rising, np.zeros(n))
    assert found.p == pytest.approx(found.smallest_p) == pytest.approx(by_signs(n))
    yes = mcnemar(np.ones(n), np.zeros(n))
    assert yes.p == pytest.approx(yes.smallest_p) == pytest.approx(by_signs(n))
    assert by_signs(4) == 0.125
    assert by_signs(0) == 1.0


def test_people_without_a_difference_do_not_help():
    found = wilcoxon(np.array([1.0, 2.0, 3.0, 4.0, 0.0, 0.0]), np.zeros(6))
    assert found.smallest_p == 0.125
    assert mcnemar(np.array([1.0, 1.0, 0.0, 1.0, 1.0]), np.zeros(5)).smallest_p == 0.125


def test_below_six_people_ranks_have_no_95_percent_interval():
    values = np.array([1.0, 2.5, -0.5, 4.0, 3.0, 6.0])
    for n in (4, 5):
        found = wilcoxon(values[:n], np.zeros(n)).interval
        assert isinstance(found, NotComputable)
        assert "too few for a 95 % interval" in found.reason
    six = wilcoxon(values, np.zeros(6)).interval
    assert (six.low, six.high) == (-0.5, 6.0)


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0, 4.0, 5.0], [3.0, 3.0, 3.0, 3.0, 4.0]])
def test_no_order_of_a_quantity_has_a_smaller_p(values, rng):
    basis, centred = basis_of(rng.standard_normal((5, 2))), np.array(values) - np.mean(values)
    shares = np.round(explained_by(basis, np.array(list(permutations(centred)))), 9)
    smallest = min(float(np.mean(shares >= one)) for one in shares)
    assert by_orders(np.array(values), 10**9) <= smallest + 1e-12
    assert by_orders(np.array([3.0, 3.0, 3.0, 3.0, 4.0]), 9999) == 0.2
    assert by_orders(np.arange(30.0), 199) == 0.005


@pytest.mark.parametrize(("first", "second"), [(2, 2), (1, 5), (3, 4)])
def test_no_grouping_has_a_smaller_p(first, second, rng):
    n = first + second
    basis = basis_of(rng.standard_normal((n, 1)))
    weights = []
    for chosen in combinations(range(n), first):
        weight = np.full(n, -1.0 / second)
        weight[list(chosen)] = 1.0 / first
        weights.append(weight)
    shares = np.round(explained_by(basis, np.array(weights)), 9)
    smallest = min(float(np.mean(shares >= one)) for one in shares)
    assert by_groups(first, second, 10**9) == pytest.approx(smallest)


@pytest.mark.parametrize(
    "ranks", [[[-1.0, 0.0, 1.0]] * 3, [[-0.5, 0.5]] * 4, [[-0.5, -0.5, 1.0], [-1.0, 0.0, 1.0]]]
)
def test_no_ranking_has_a_smaller_p(ranks):
    every = [list(permutations(row)) for row in ranks]
    spread = np.array([np.square(np.sum(rows, axis=0)).sum() for rows in product(*every)])
    smallest = float(np.mean(spread >= spread.max() - 1e-9))
    assert by_ranks(np.array(ranks)) == pytest.approx(smallest)


def test_two_conditions_and_four_people_are_undecided_although_chi2_says_otherwise(rng):
    found = friedman(np.tile([0.0, 1.0], (4, 1)), rng=rng)
    assert found.p < 0.05 < found.smallest_p == 0.125


def test_holms_smallest_over_pairs_is_reached_by_the_clearest_data():
    table = np.arange(6.0)[:, None] + np.array([0.0, 10.0, 30.0]) * np.arange(1.0, 7.0)[:, None]
    for pair in all_pairs(table, ("a", "b", "c"), wilcoxon):
        assert pair.p_holm == pair.smallest_p_holm == pytest.approx(3 * by_signs(6))


@pytest.mark.parametrize("correct", [holm, benjamini_hochberg])
def test_corrected_values_never_fall_when_a_p_rises(correct, rng):
    """So the correction of the smallest p-values is the smallest there can be after correction."""
    for _ in range(500):
        smallest = rng.uniform(size=int(rng.integers(1, 7))) ** 2
        found = np.minimum(1.0, smallest + rng.choice([0.0, 0.1, 0.5], size=len(smallest)))
        assert (correct(found) >= correct(smallest) - 1e-12).all()
