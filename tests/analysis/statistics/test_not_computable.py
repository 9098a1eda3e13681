"""What cannot be computed says why: no NaN, no warning, no exception."""

import dataclasses
from collections.abc import Callable
from math import isnan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.analysis.statistics.bootstrap import resample_counts
from steerlab.analysis.statistics.correlation import (
    paper_correlation,
    pearson,
    score_test,
    shapiro_wilk,
    spearman,
)
from steerlab.analysis.statistics.mixed_model import mixed_model
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.statistics.omnibus import cochran_q, friedman, repeated_measures
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import mcnemar, wilcoxon
from steerlab.analysis.statistics.two_groups import hotelling_t2, welch_t
from steerlab.sim.errors import InvalidConfig

SAME, RISING = np.full(8, 3.0), np.arange(8.0)
UNEVEN = np.array([0.3, 2.0, -1.0, 4.0, 0.0, 1.5, 2.5, -3.0])
FIRST_FOUR = np.arange(8) < 4
YES = (UNEVEN > 1.0).astype(float)


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def mixed(y: np.ndarray, column: np.ndarray, person: np.ndarray):
    return mixed_model(y, {"condition": column}, person)


CASES: dict[str, tuple[Callable[[], object], str]] = {
    "shapiro, three": (lambda: shapiro_wilk(RISING[:3]), "people: 3; at least 4 are needed"),
    "shapiro, nobody": (lambda: shapiro_wilk(RISING[:0]), "people: 0"),
    "shapiro, constant": (lambda: shapiro_wilk(SAME), "all values of the sample are 3"),
    "shapiro, 6,000": (lambda: shapiro_wilk(np.arange(6000.0)), "6000 values"),
    "score, constant x": (lambda: score_test(SAME, RISING), "all values of x are 3"),
    "score, constant y": (lambda: score_test(RISING, SAME), "all values of y are 3"),
    "score, a line": (lambda: score_test(RISING, 2.0 * RISING + 1.0), "y lies on a line"),
    "score, level": (
        lambda: score_test(np.array([-1.0, 1.0] * 4), np.array([1.0, 1.0, 2.0, 2.0] * 2)),
        "the fitted line is level",
    ),
    "pearson, three": (lambda: pearson(RISING[:3], UNEVEN[:3]), "people: 3"),
    "pearson, constant": (lambda: pearson(SAME, RISING), "all values of x are 3"),
    "spearman, constant": (lambda: spearman(RISING, SAME), "all values of y are 3"),
    "switch, constant": (lambda: paper_correlation(RISING, SAME), "all values of y are 3"),
    "multiple, five": (
        lambda: multiple_correlation(
            np.column_stack([RISING, UNEVEN, YES])[:5], UNEVEN[:5], rng=rng()
        ),
        "people: 5; at least 6 are needed",
    ),
    "multiple, constant construct": (
        lambda: multiple_correlation(RISING[:, None], SAME, rng=rng()),
        "all values of the construct are 3",
    ),
    "multiple, constant embedding": (
        lambda: multiple_correlation(np.column_stack([RISING, SAME]), UNEVEN, rng=rng()),
        "all values of dimension 1 are 3",
    ),
    "multiple, dependent": (
        lambda: multiple_correlation(np.column_stack([RISING, -RISING]), UNEVEN, rng=rng()),
        "2 dimensions span only 1",
    ),
    "welch, one woman": (lambda: welch_t(UNEVEN[:1], UNEVEN[1:]), "people in the smaller group: 1"),
    "welch, all alike": (lambda: welch_t(SAME, SAME), "all values of both groups are 3"),
    "welch, alike within": (lambda: welch_t(SAME, SAME + 1.0), "nobody differs within a group"),
    "hotelling, constant": (
        lambda: hotelling_t2(np.column_stack([SAME, UNEVEN]), FIRST_FOUR, rng=rng()),
        "all values of dimension 0 are 3",
    ),
    "hotelling, alike within": (
        lambda: hotelling_t2(1.0 * FIRST_FOUR[:, None], FIRST_FOUR, rng=rng()),
        "nobody differs within a group",
    ),
    "hotelling, no men": (
        lambda: hotelling_t2(UNEVEN[:, None], np.ones(8, dtype=bool), rng=rng()),
        "people in the smaller group: 0",
    ),
    "friedman, three": (lambda: friedman(np.eye(3), rng=rng()), "people: 3"),
    "friedman, all ties": (lambda: friedman(np.ones((8, 3)), rng=rng()), "nobody ranks"),
    "cochran, all succeed": (lambda: cochran_q(np.ones((8, 3)), rng=rng()), "nobody ranks"),
    "anova, three": (lambda: repeated_measures(np.eye(3)), "people: 3"),
    "anova, constant": (lambda: repeated_measures(np.ones((8, 3))), "conditions differ alike"),
    "anova, parallel": (
        lambda: repeated_measures(UNEVEN[:, None] + np.arange(3.0)),
        "conditions differ alike",
    ),
    "wilcoxon, three": (lambda: wilcoxon(RISING[:3], UNEVEN[:3]), "people: 3"),
    "wilcoxon, all equal": (lambda: wilcoxon(RISING, RISING), "nobody differs"),
    "mcnemar, three": (lambda: mcnemar(YES[:3], YES[:3]), "people: 3"),
    "mcnemar, all equal": (lambda: mcnemar(YES, YES), "nobody differs"),
    "mixed, one row each": (lambda: mixed(UNEVEN, YES, RISING), "8 rows do not tell condition"),
    "mixed, constant column": (
        lambda: mixed(UNEVEN, SAME, np.repeat(RISING[:4], 2)),
        "8 rows do not tell condition apart",
    ),
    "mixed, no residual": (
        lambda: mixed(np.repeat(UNEVEN[:4], 2), np.tile([0.0, 1.0], 4), np.repeat(RISING[:4], 2)),
        "people and the fixed effects explain everything",
    ),
    "mixed, two people": (
        lambda: mixed(UNEVEN, np.tile([0.0, 1.0], 4), np.repeat(RISING[:2], 4)),
        "people: 2",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_it_says_why(case):
    compute, reason = CASES[case]
    found = compute()
    assert isinstance(found, NotComputable), found
    assert reason in found.reason
    assert str(found) == f"not computable: {found.reason}"


def test_where_an_interval_is_missing_the_test_is_still_there():
    """One person of eight tells conditions apart; many resamples miss them."""
    success = np.ones((8, 3))
    success[0, 0] = 0.0
    found = cochran_q(success, rng=rng())
    assert isinstance(found.interval, NotComputable)
    assert "only 1 of 8" in found.interval.reason
    assert found.statistic == pytest.approx(2.0)


@pytest.mark.parametrize(
    "call",
    [
        lambda: pearson(RISING, UNEVEN[:7]),
        lambda: pearson(RISING, np.full(8, np.nan)),
        lambda: pearson(RISING, UNEVEN, confidence=95.0),
        lambda: friedman(RISING[:, None], rng=rng()),
        lambda: multiple_correlation(np.empty((8, 0)), RISING, rng=rng()),
        lambda: cochran_q(np.full((8, 3), 2.0), rng=rng()),
        lambda: mcnemar(RISING, UNEVEN),
        lambda: multiple_correlation(UNEVEN[:, None], RISING, rng=rng(), permutations=9),
        lambda: resample_counts(8, 10, rng()),
        lambda: hotelling_t2(UNEVEN[:, None], np.arange(8), rng=rng()),
    ],
)
def test_a_callers_mistake_is_an_error(call):
    with pytest.raises(InvalidConfig):
        call()


VALUES = st.lists(st.integers(0, 3), min_size=0, max_size=12).map(lambda v: np.array(v, float))


def _finite(found) -> bool:
    if isinstance(found, float):
        return not isnan(found)
    if dataclasses.is_dataclass(found):
        return all(_finite(getattr(found, one.name)) for one in dataclasses.fields(found))
    if isinstance(found, np.ndarray):
        return bool(np.isfinite(found).all())
    return True


@settings(max_examples=30)
@given(x=VALUES, y=VALUES)
def test_no_answers_give_nan(x, y):
    """Few people and four answers: constants, ties and lines of every kind."""
    size = min(len(x), len(y))
    x, y = x[:size], y[:size]
    table = np.column_stack([x, y, y[::-1]])
    few = {"rng": rng(), "resamples": 199}
    found = [shapiro_wilk(x), score_test(x, y), pearson(x, y), spearman(x, y), welch_t(x, y)]
    found += [paper_correlation(x, y), wilcoxon(x, y), mcnemar(1.0 * (x > 1), 1.0 * (y > 1))]
    found += [friedman(table, **few), cochran_q(1.0 * (table > 1), **few), repeated_measures(table)]
    found.append(multiple_correlation(table[:, :2], y[::-1], rng=rng(), permutations=19))
    found.append(
        hotelling_t2(table[:, :2], np.arange(size) < size // 2, rng=rng(), permutations=19)
    )
    assert all(_finite(one) for one in found)
