"""Cronbach's alpha and Feldt's interval against exact arithmetic and numbers that R printed.

R was not run for these tests: the values are those in the documents of R packages, named beside.
"""

from fractions import Fraction
from statistics import variance

import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.study.surveys.reliability import cronbach_alpha

# LSAT section 6, five items of 1,000 people (Bock & Lieberman 1970): people with each pattern of
# right answers, from 00000 to 11111. R: library(ltm); cronbach.alpha(LSAT) prints 0.295.
LSAT = """3 6 2 11 1 1 3 4 1 8 0 16 0 3 2 15
          10 29 14 81 3 28 15 80 16 56 21 173 11 61 28 298"""
SMALL = [(1, 2, 3), (2, 2, 4), (3, 5, 3), (4, 4, 5), (5, 4, 4), (2, 1, 2)]


def _with_alpha(alpha: float, people: int, items: int) -> np.ndarray:
    """A table that has exactly this alpha: person parts and error parts, uncorrelated."""
    rng = np.random.default_rng(4)
    base = rng.standard_normal((people, items + 1))
    base -= base.mean(axis=0)
    base = np.linalg.qr(base)[0]
    # with persons' variance v and errors' 1, alpha = items·v / (items·v + 1)
    person_std = np.sqrt(alpha / (1.0 - alpha) / items)
    return base[:, :1] * person_std + base[:, 1:]


def test_alpha_equals_exact_arithmetic():
    rows = [[Fraction(value) for value in row] for row in SMALL]
    within = sum(variance(column) for column in zip(*rows, strict=True))
    exact = Fraction(3, 2) * (1 - within / variance([sum(row) for row in rows]))
    # by hand: 3/2 · (1 - (13/6 + 12/5 + 11/10) / (184/15))
    assert exact == Fraction(297, 368)
    assert cronbach_alpha(np.array(SMALL, dtype=float)).alpha == pytest.approx(297 / 368, abs=1e-12)


def test_alpha_of_the_lsat_data():
    counts = [int(word) for word in LSAT.split()]
    assert sum(counts) == 1000
    patterns = [[float(digit) for digit in f"{number:05b}"] for number in range(32)]
    found = cronbach_alpha(np.repeat(np.array(patterns), counts, axis=0))
    assert round(found.alpha, 3) == 0.295
    assert (found.people, found.items, found.left_out) == (1000, 5, 0)


@pytest.mark.parametrize(
    ("alpha", "people", "items", "confidence", "low", "high", "digits"),
    [
        # feldt1.return(0.913, 873, 20, 0.95, 0), R code of C. Evans, MRC CBU statistics wiki
        (0.913, 873, 20, 0.95, 0.9044024, 0.9211588, 7),
        # cocron::cronbach.alpha.CI(alpha=.790, n=41, items=26, conf.level=.9), cocron's tests,
        # after Feldt, Woodruff & Salih (1987), p. 95
        (0.790, 41, 26, 0.90, 0.705, 0.862, 3),
        # psych::alpha.ci(.74, 100, p.val=.05, n.var=4), psych's examples
        (0.74, 100, 4, 0.95, 0.65, 0.81, 2),
    ],
)
def test_feldts_interval_is_what_r_printed(alpha, people, items, confidence, low, high, digits):
    found = cronbach_alpha(_with_alpha(alpha, people, items), confidence=confidence)
    assert found.alpha == pytest.approx(alpha, abs=1e-12)
    assert (round(found.low, digits), round(found.high, digits)) == (low, high)


def test_the_interval_covers_as_often_as_it_says():
    """Feldt's interval is exact for parallel normal items."""
    rng = np.random.default_rng(8)
    truth, studies = 0.8, 3000  # four items with variance 1 shared and 1 of their own
    hits = 0
    for _ in range(studies):
        table = rng.standard_normal((34, 1)) + rng.standard_normal((34, 4))
        found = cronbach_alpha(table, confidence=0.9)
        hits += found.low <= truth <= found.high
    assert abs(hits / studies - 0.9) < 4 * np.sqrt(0.9 * 0.1 / studies)


def test_alpha_may_be_negative():
    found = cronbach_alpha(np.array([(1, 5), (2, 4), (5, 2), (4, 1)], dtype=float))
    assert found.alpha < 0
    assert found.low < found.alpha < found.high < 1


def test_equal_items_have_alpha_one():
    found = cronbach_alpha(np.array([(1, 1), (2, 2), (5, 5)], dtype=float))
    assert (found.alpha, found.low, found.high) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("constant", [0.0, 3.0])
def test_a_constant_item_is_left_out_as_psych_does(constant):
    """``psych::alpha``: "Item = ... had no variance and was deleted", and k is one less."""
    full = np.array(SMALL, dtype=float)
    with_it = cronbach_alpha(np.insert(full, 1, constant, axis=1))
    without = cronbach_alpha(full)
    assert (with_it.alpha, with_it.low, with_it.high) == (without.alpha, without.low, without.high)
    assert (with_it.items, with_it.constant) == (3, 1)
    assert (without.items, without.constant) == (3, 0)


def test_an_item_that_only_people_with_gaps_answered_otherwise_is_constant():
    full = np.insert(np.array(SMALL, dtype=float), 1, 3.0, axis=1)
    found = cronbach_alpha(np.vstack([full, [1, 5, np.nan, 2]]))
    assert (found.alpha, found.constant) == (pytest.approx(297 / 368, abs=1e-12), 1)


def test_people_with_a_gap_are_left_out():
    full = np.array(SMALL, dtype=float)
    gaps = np.vstack([full, [np.nan, 3, 3], [1, np.nan, np.nan]])
    with_gaps, without = cronbach_alpha(gaps), cronbach_alpha(full)
    assert with_gaps.alpha == without.alpha
    assert (with_gaps.people, with_gaps.left_out) == (6, 2)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        (np.full((5, 4), 3.0), "everyone has the same score, so nothing varies"),
        (np.array([(1, 3), (2, 2), (3, 1.0)]), "everyone has the same score, so nothing varies"),
        (np.ones((5, 1)), "items: 1; at least 2 are needed"),
        (np.array([(1, 2), (2, 3.0)]), "people with all answers: 2; at least 3 are needed"),
        (np.full((9, 3), np.nan), "people with all answers: 0; at least 3 are needed"),
        (np.ones((0, 3)), "people with all answers: 0; at least 3 are needed"),
        (np.array([(1, 3), (2, 3), (5, 3.0)]), "items that vary: 1; at least 2 are needed"),
    ],
)
def test_where_alpha_is_not_defined_it_says_why(table, reason):
    found = cronbach_alpha(table)
    assert (found.alpha, found.low, found.high, found.reason) == (None, None, None, reason)


@pytest.mark.parametrize("confidence", [0.0, 1.0, float("nan")])
def test_a_confidence_that_is_none_is_refused(confidence):
    with pytest.raises(InvalidConfig, match="confidence"):
        cronbach_alpha(np.ones((3, 3)), confidence=confidence)


@pytest.mark.parametrize("table", [np.ones(3), np.array([(1, 2), (3, np.inf)])])
def test_what_is_no_table_is_refused(table):
    with pytest.raises(InvalidConfig, match="no finite table"):
        cronbach_alpha(table)
