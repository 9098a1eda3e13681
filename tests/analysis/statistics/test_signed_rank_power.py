"""Power of Wilcoxon's test: what simulated studies reject by the test itself, and where it has none."""

from math import sqrt

import numpy as np
import pytest
from scipy.special import ndtr

from steerlab.analysis.statistics.noncentral import paired_power
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.paired import MOST_EXACT, wilcoxon
from steerlab.analysis.statistics.signed_rank_power import (
    STUDIES,
    signed_rank_power,
    smallest_signed_rank,
)
from steerlab.sim.errors import InvalidConfig


@pytest.mark.parametrize("n", [4, 5])
def test_five_people_find_nothing_however_large_it_is(n):
    """The paired t test, whose power this was taken to be, would find d = 3 nearly always."""
    assert signed_rank_power(3.0, n) == 0.0
    assert paired_power(3.0, n) > 0.9
    assert isinstance(smallest_signed_rank(n), NotComputable)


def test_six_people_must_all_differ_one_way():
    """Then the power is known: Φ(d) to the sixth, and as much for the other direction."""
    expected = ndtr(1.5) ** 6 + ndtr(-1.5) ** 6
    error = sqrt(expected * (1.0 - expected) / STUDIES)
    assert signed_rank_power(1.5, 6) == pytest.approx(expected, abs=4.0 * error)


@pytest.mark.parametrize(("d", "n", "alpha"), [(0.8, 9, 0.05), (0.6, 20, 0.05), (0.7, 20, 0.0125)])
def test_it_is_the_share_of_studies_that_the_test_rejects(d, n, alpha):
    samples = np.random.default_rng(3).normal(d, 1.0, (3000, n))
    found = np.mean([wilcoxon(sample, np.zeros(n)).p < alpha for sample in samples])
    error = sqrt(found * (1.0 - found) / 3000)
    assert signed_rank_power(d, n, alpha=alpha) == pytest.approx(found, abs=4.0 * error)


def test_from_fifty_people_on_it_goes_on_where_it_was():
    exact, beyond = (signed_rank_power(0.4, n) for n in (MOST_EXACT, MOST_EXACT + 1))
    assert 0.0 < beyond - exact < 0.02


@pytest.mark.parametrize("n", [6, 12, 34, 80])
def test_the_smallest_effect_has_the_power_asked_for(n):
    d = smallest_signed_rank(n)
    assert signed_rank_power(d, n) == pytest.approx(0.8, abs=0.01)
    assert d > smallest_signed_rank(n + 1)


def test_nonsense_is_refused():
    for call in (lambda: signed_rank_power(0.5, 1), lambda: smallest_signed_rank(9, power=1.0)):
        with pytest.raises(InvalidConfig):
            call()
