"""Studies without any effect: a test at 5 % may reject one in twenty of them, and no more.

Each rate is over 2,000 studies, so its Monte-Carlo error is 0.5 %; rates may be three off.
"""

from collections.abc import Callable
from math import sqrt

import numpy as np
import pytest

from steerlab.analysis.statistics.correlation import paper_correlation, pearson, spearman
from steerlab.analysis.statistics.mixed_model import mixed_model
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.statistics.omnibus import cochran_q, friedman, repeated_measures
from steerlab.analysis.statistics.paired import mcnemar, wilcoxon
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t

pytestmark = pytest.mark.slow

STUDIES = 2000
ALPHA = 0.05
ERROR = sqrt(ALPHA * (1.0 - ALPHA) / STUDIES)
PEOPLE, WOMEN, CONDITIONS = 34, 10, 3
PERMUTATIONS = 399
FEWEST_RESAMPLES = 199

Study = Callable[[np.random.Generator], float]


def multiple_r(rng: np.random.Generator) -> float:
    """Skewed embeddings and a five-step construct: the permutation test supposes neither away."""
    embedding = rng.standard_exponential((PEOPLE, 2))
    construct = rng.integers(1, 6, PEOPLE).astype(float)
    return multiple_correlation(embedding, construct, rng=rng, permutations=PERMUTATIONS).p


def hotelling(rng: np.random.Generator) -> float:
    embedding = rng.standard_exponential((PEOPLE, 2))
    return hotelling_t2(embedding, np.arange(PEOPLE) < WOMEN, rng=rng, permutations=PERMUTATIONS).p


def welch(rng: np.random.Generator) -> float:
    """The smaller group varies twice as much, where Student's test would reject too often."""
    return welch_t(2.0 * rng.standard_normal(WOMEN), rng.standard_normal(PEOPLE - WOMEN)).p


def pearson_(rng: np.random.Generator) -> float:
    return pearson(*rng.standard_normal((2, PEOPLE))).p


def spearman_(rng: np.random.Generator) -> float:
    return spearman(rng.standard_exponential(PEOPLE), rng.integers(8, 57, PEOPLE).astype(float)).p


def paper_switch(rng: np.random.Generator) -> float:
    x, y = rng.standard_normal(PEOPLE), rng.standard_exponential(PEOPLE)
    return paper_correlation(x, y).correlation.p


def friedman_(rng: np.random.Generator) -> float:
    people = rng.standard_normal((PEOPLE, 1))
    table = people + rng.standard_exponential((PEOPLE, CONDITIONS))
    return friedman(table, rng=rng, resamples=FEWEST_RESAMPLES).p


def repeated_measures_(rng: np.random.Generator) -> float:
    """One condition varies three times as much: without the correction 5 % would be passed."""
    people = rng.standard_normal((PEOPLE, 1))
    return repeated_measures(people + rng.standard_normal((PEOPLE, 3)) * [1.0, 1.0, 3.0]).p


def mixed(rng: np.random.Generator) -> float:
    person = np.repeat(np.arange(float(PEOPLE)), CONDITIONS)
    order = np.tile(np.arange(float(CONDITIONS)), (PEOPLE, 1))
    condition = rng.permuted(order, axis=1).ravel()
    y = np.repeat(rng.standard_normal(PEOPLE), CONDITIONS) + rng.standard_normal(len(person))
    columns = {
        "second": (condition == 1.0).astype(float),
        "third": (condition == 2.0).astype(float),
        "order": order.ravel(),
    }
    return mixed_model(y + 0.5 * order.ravel(), columns, person).joint_test(["second", "third"]).p


def cochran(rng: np.random.Generator) -> float:
    easy = rng.uniform(0.2, 0.8, (PEOPLE, 1))
    success = (rng.uniform(size=(PEOPLE, CONDITIONS)) < easy).astype(float)
    return cochran_q(success, rng=rng, resamples=FEWEST_RESAMPLES).p


def wilcoxon_(rng: np.random.Generator) -> float:
    return wilcoxon(*rng.standard_exponential((2, PEOPLE))).p


def mcnemar_(rng: np.random.Generator) -> float:
    first, second = (rng.uniform(size=(2, PEOPLE)) < 0.5).astype(float)
    return mcnemar(first, second).p


def rejected(study: Study) -> float:
    seeds = np.random.SeedSequence(2026).spawn(STUDIES)
    return float(np.mean([study(np.random.default_rng(seed)) <= ALPHA for seed in seeds]))


@pytest.mark.parametrize(
    "study",
    [
        multiple_r,
        hotelling,
        welch,
        pearson_,
        spearman_,
        paper_switch,
        friedman_,
        repeated_measures_,
        mixed,
        cochran,
        wilcoxon_,
    ],
    ids=lambda study: study.__name__.strip("_"),
)
def test_a_true_null_is_rejected_once_in_twenty(study: Study):
    assert abs(rejected(study) - ALPHA) <= 3.0 * ERROR


def test_mcnemars_exact_test_rejects_no_more_than_that():
    """Counts are few, so an exact test stays below its level."""
    assert 0.0 < rejected(mcnemar_) <= ALPHA + 3.0 * ERROR


def test_a_real_effect_is_found_more_often():
    """What would be wrong with a test that never rejects."""

    def related(rng: np.random.Generator) -> float:
        embedding = rng.standard_normal((PEOPLE, 2))
        construct = embedding @ [0.5, -0.5] + rng.standard_normal(PEOPLE)
        return multiple_correlation(embedding, construct, rng=rng, permutations=PERMUTATIONS).p

    assert rejected(related) > 0.8
