"""The same numbers by another way: statsmodels, full enumeration, simulation, arithmetic by hand."""

from itertools import permutations, product
from math import sqrt

import numpy as np
import pytest
from scipy.stats import rankdata
from statsmodels.stats.diagnostic import het_breuschpagan

from steerlab.analysis.statistics.corrections import benjamini_hochberg, holm
from steerlab.analysis.statistics.correlation import (
    paper_correlation,
    pearson,
    score_test,
    shapiro_wilk,
    spearman,
)
from steerlab.analysis.statistics.mixed_model import mixed_model
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation, permutation_p
from steerlab.analysis.statistics.omnibus import cochran_q, repeated_measures
from steerlab.analysis.statistics.paired import mcnemar, wilcoxon
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t
from steerlab.sim.errors import InvalidConfig


def test_score_test_is_statsmodels_without_robustness(rng):
    x = rng.standard_normal(34)
    y = x + np.exp(x) * rng.standard_normal(34)
    design = np.column_stack([np.ones(34), x])
    fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    among = np.column_stack([np.ones(34), fitted])
    statistic, p, _, _ = het_breuschpagan(y - fitted, among, robust=False)
    koenker = het_breuschpagan(y - fitted, among, robust=True)[0]
    found = score_test(x, y)
    assert (found.statistic, found.p) == pytest.approx((statistic, p), rel=1e-9)
    assert abs(found.statistic - koenker) > 0.1


def test_cochran_q_is_cochrans_formula(rng):
    success = (rng.uniform(size=(20, 4)) < [0.3, 0.5, 0.6, 0.7]).astype(float)
    columns, rows = success.sum(axis=0), success.sum(axis=1)
    q = 3 * (4 * columns @ columns - columns.sum() ** 2) / (4 * rows.sum() - rows @ rows)
    assert cochran_q(success, rng=rng).statistic == pytest.approx(q)


def test_spearman_counts_all_orders():
    x, y = np.arange(6.0), np.array([2.0, 1.0, 4.0, 3.0, 6.0, 5.0])
    rho = np.array([np.corrcoef(x, order)[0, 1] for order in permutations(range(6))])
    found = spearman(x, y)
    assert found.p == pytest.approx(2.0 * np.mean(rho >= found.r - 1e-9))


def test_wilcoxon_counts_all_signs():
    first = np.array([1.2, -0.4, 3.1, 2.2, -1.7, 0.9, 2.8])
    ranks = rankdata(np.abs(first))
    sums = np.array([ranks @ signs for signs in product([0.0, 1.0], repeat=7)])
    found = wilcoxon(first, np.zeros(7))
    assert found.p == pytest.approx(2.0 * min(np.mean(sums >= found.v), np.mean(sums <= found.v)))
    assert found.rank_biserial == pytest.approx((2.0 * found.v - 28.0) / 28.0)


def test_multiple_r_of_one_dimension_is_pearsons(rng):
    x, y = rng.standard_normal((2, 34))
    plane = multiple_correlation(x[:, None], y, rng=rng)
    line = pearson(x, y)
    assert (plane.r, plane.f_p) == pytest.approx((abs(line.r), line.p))
    assert plane.p == pytest.approx(line.p, abs=4 * sqrt(line.p * (1 - line.p) / 9999))


def test_multiple_r_does_not_change_when_the_plane_is_turned(rng):
    """A single dimension's r does: that is why multiple R is the primary test."""
    embedding, y = rng.standard_normal((34, 2)), rng.standard_normal(34)
    y += embedding[:, 0]
    turned = embedding @ np.array([[0.0, 1.0], [-1.0, 0.0]]) * [1.0, 7.0]
    r = [multiple_correlation(one, y, rng=rng, permutations=99).r for one in (embedding, turned)]
    assert r[0] == pytest.approx(r[1])
    assert abs(pearson(embedding[:, 0], y).r - pearson(turned[:, 0], y).r) > 0.2


def test_multiple_r_interval_covers_as_often_as_it_says(rng):
    """With the embedding fixed and normal residuals the noncentral F is exact."""
    embedding = rng.standard_normal((34, 2))
    signal = embedding @ [0.4, 0.3]
    truth = np.square(signal - signal.mean()).sum()
    truth = sqrt(truth / (truth + 34))
    hits = 0
    for _ in range(400):
        y = signal + rng.standard_normal(34)
        found = multiple_correlation(embedding, y, rng=rng, permutations=19).interval
        hits += found.low <= truth <= found.high
    assert abs(hits / 400 - 0.95) <= 4 * sqrt(0.95 * 0.05 / 400)


def test_permutation_p_is_never_zero():
    assert permutation_p(5.0, np.zeros(99)) == 0.01
    assert permutation_p(0.0, np.zeros(99)) == 1.0


def test_hotelling_of_one_dimension_is_students_t_squared(rng):
    values = rng.standard_normal(34)
    in_first = np.arange(34) < 10
    values[in_first] += 0.9
    found = hotelling_t2(values[:, None], in_first, rng=rng)
    first, second = values[in_first], values[~in_first]
    pooled = sqrt((9 * first.var(ddof=1) + 23 * second.var(ddof=1)) / 32)
    distance = abs(first.mean() - second.mean()) / pooled
    assert found.distance == pytest.approx(distance)
    assert found.t2 == pytest.approx(distance**2 * 240 / 34)
    assert abs(welch_t(first, second).g) == pytest.approx(
        distance * (1 - 3 / (4 * 32 - 1)), rel=1e-3
    )


def test_anova_of_two_conditions_is_the_paired_t_test(rng):
    table = rng.standard_normal((12, 2)) + np.array([0.0, 0.5])
    difference = table[:, 0] - table[:, 1]
    t = difference.mean() / (difference.std(ddof=1) / sqrt(12))
    found = repeated_measures(table)
    assert found.statistic == pytest.approx(t**2)
    assert found.epsilon == pytest.approx(1.0)


def test_effect_sizes_have_signs_of_the_first_condition():
    more, less = np.array([1.0, 1.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 0.0, 1.0])
    assert mcnemar(more, less).difference == pytest.approx(0.4)
    assert welch_t(more, less).difference == pytest.approx(0.4)
    assert wilcoxon(more + 1.0, np.zeros(5)).rank_biserial == 1.0


@pytest.mark.parametrize(
    ("x", "why"), [("normal", ()), ("skewed", ("the embedding is not normal",))]
)
def test_the_papers_switch(rng, x, why):
    embedding = rng.standard_normal(34) if x == "normal" else rng.standard_exponential(34) ** 2
    construct = rng.standard_normal(34)
    found = paper_correlation(embedding, construct)
    assert found.label == "paper-compatible"
    assert found.why == why
    assert found.correlation == (spearman if why else pearson)(embedding, construct)


def test_a_cone_switches_to_spearman():
    """The variance alone fails, as R's ncvTest says."""
    rng = np.random.default_rng(7)
    x = rng.uniform(-2.0, 2.0, 34)
    found = paper_correlation(x, np.exp(1.2 * x) * rng.standard_normal(34))
    assert "the variance is not constant" in found.why
    assert found.correlation.method == "spearman"


def test_perfect_correlations_have_an_interval_of_one_point():
    x = np.arange(10.0)
    found = pearson(x, -3.0 * x)
    ends = (found.r, found.p, found.interval.low, found.interval.high)
    assert ends == pytest.approx((-1.0, 0.0, -1.0, -1.0), abs=1e-12)


def test_tiny_and_huge_values_correlate_like_others():
    x = np.array([1.0, 2.0, 4.0, 3.0, 5.0])
    assert pearson(1e-200 * x, 1e200 * x**2).r == pytest.approx(pearson(x, x**2).r)


def test_corrections_of_one_p_change_nothing():
    assert holm(np.array([0.04])) == pytest.approx([0.04])
    assert benjamini_hochberg(np.array([0.04])) == pytest.approx([0.04])
    assert len(holm(np.array([]))) == 0
    with pytest.raises(InvalidConfig, match="lie in 0 to 1"):
        holm(np.array([1.2]))


def test_the_papers_table_2_holds_only_the_two_style_correlations():
    """r at n = 34 gives the printed p-values; after Holm or BH only style is left."""
    p = np.array([0.28, 0.18, 0.15, 0.75, 0.22, 0.43, 0.89, 0.16, 0.34, 0.0000066, 0.0000043])
    assert (holm(p) < 0.05).tolist() == [False] * 9 + [True] * 2
    assert (benjamini_hochberg(p) < 0.05).tolist() == [False] * 9 + [True] * 2


@pytest.mark.parametrize("between", [0.0, 1.0, 5.0])
def test_the_mixed_model_is_least_squares_at_the_best_variances(rng, between):
    """With a quarter of the rows missing, by matrices of all rows."""
    person, second = np.repeat(np.arange(12.0), 3), np.tile([0.0, 1.0, 0.0], 12)
    y = between * np.repeat(rng.standard_normal(12), 3) + rng.standard_normal(36)
    keep = rng.uniform(size=36) > 0.25
    y, second, person = y[keep], second[keep], person[keep]
    design = np.column_stack([np.ones(len(y)), second])
    found = mixed_model(y, {"second": second}, person)

    def fit(person_sd):
        shared = np.equal.outer(person, person)
        variance = person_sd**2 * shared + found.residual_sd**2 * np.eye(len(y))
        information = design.T @ np.linalg.solve(variance, design)
        beta = np.linalg.solve(information, design.T @ np.linalg.solve(variance, y))
        left = y - design @ beta
        criterion = np.linalg.slogdet(variance)[1] + np.linalg.slogdet(information)[1]
        return beta, information, criterion + left @ np.linalg.solve(variance, left)

    beta, information, best = fit(found.person_sd)
    assert [one.estimate for one in found.coefficients] == pytest.approx(beta)
    errors = np.sqrt(np.diag(np.linalg.inv(information)))
    assert [one.error for one in found.coefficients] == pytest.approx(errors)
    assert best < fit(found.person_sd + 0.05)[2]
    assert found.person_sd == 0.0 or best < fit(found.person_sd - 0.05)[2]


def test_a_joint_test_of_one_coefficient_is_its_t_squared(rng):
    person, second = np.repeat(np.arange(9.0), 2), np.tile([0.0, 1.0], 9)
    found = mixed_model(rng.standard_normal(18), {"second": second}, person)
    joint = found.joint_test(["second"])
    assert (joint.f, joint.p) == pytest.approx(
        (found.coefficients[1].t ** 2, found.coefficients[1].p)
    )
    with pytest.raises(InvalidConfig, match="No coefficient 'third'"):
        found.joint_test(["third"])


def test_rows_of_another_number_are_refused(rng):
    person = np.repeat(np.arange(4.0), 2)
    for y, column in ((np.ones(7), np.ones(8)), (np.ones(8), np.ones(7))):
        with pytest.raises(InvalidConfig, match="another number"):
            mixed_model(y, {"condition": column}, person)


@pytest.mark.parametrize("unit", [1e-30, 1e-3, 1e12])
def test_shapiro_wilk_knows_no_unit(unit):
    values = np.random.default_rng(3).standard_exponential(20)
    plain, scaled = shapiro_wilk(values), shapiro_wilk(unit * values + unit)
    assert scaled.statistic == pytest.approx(plain.statistic, abs=1e-9)
    assert scaled.p == pytest.approx(plain.p, rel=1e-6)
