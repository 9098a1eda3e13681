"""Power of multiple R and of paired differences: statsmodels' and simulation's numbers."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from steerlab.analysis.statistics.noncentral import (
    multiple_power,
    paired_power,
    smallest_multiple,
)
from steerlab.sim.errors import InvalidConfig

statsmodels_power = pytest.importorskip("statsmodels.stats.power")


@pytest.mark.parametrize(("d", "n"), [(0.2, 10), (0.5, 34), (1.2, 12), (0.0, 20)])
def test_paired_power_is_statsmodels(d, n):
    expected = statsmodels_power.TTestPower().power(d, n, 0.05)
    assert paired_power(d, n) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(("r", "n", "d"), [(0.3, 34, 4), (0.5, 34, 2), (0.6, 12, 4)])
def test_multiple_power_is_statsmodels(r, n, d):
    f2 = r * r / (1.0 - r * r)
    expected = statsmodels_power.FTestPowerF2().power(f2, d, n - d - 1, 0.05)
    assert multiple_power(r, n, d) == pytest.approx(float(expected), abs=1e-6)


# R 4.2.2, the definition that ``pwr::pwr.f2.test`` computes:
#   f <- function(r, n, d) pf(qf(.95, d, n-d-1), d, n-d-1, ncp = n*r^2/(1-r^2), lower.tail = FALSE)
@pytest.mark.parametrize(
    ("r", "n", "d", "expected"),
    [(0.3, 34, 4, 0.234586944471), (0.5, 34, 2, 0.82621508044), (0.6, 12, 4, 0.295838271348)],
)
def test_multiple_power_is_rs(r, n, d, expected):
    assert multiple_power(r, n, d) == pytest.approx(expected, abs=1e-9)


# R 4.2.2: power.t.test(n = n, delta = d, type = "paired", strict = TRUE)$power
@pytest.mark.parametrize(
    ("d", "n", "expected"), [(0.5, 34, 0.807777501279), (0.9, 12, 0.809785486284)]
)
def test_paired_power_is_rs(d, n, expected):
    assert paired_power(d, n) == pytest.approx(expected, abs=1e-9)


def test_smallest_effects_have_the_power_asked_for():
    assert multiple_power(smallest_multiple(34, 4), 34, 4) == pytest.approx(0.8, abs=1e-6)
    assert smallest_multiple(100, 4) < smallest_multiple(34, 4) < smallest_multiple(34, 8)


def test_without_an_effect_power_is_alpha():
    assert multiple_power(0.0, 34, 4) == pytest.approx(0.05, abs=1e-12)
    assert paired_power(0.0, 34, alpha=0.01) == pytest.approx(0.01, abs=1e-12)


def test_paired_power_is_what_simulated_studies_have():
    rng = np.random.default_rng(0)
    samples = rng.normal(0.6, 1.0, (4000, 20))
    found = np.mean(ttest_1samp(samples, 0.0, axis=1).pvalue < 0.05)
    assert paired_power(0.6, 20) == pytest.approx(found, abs=0.03)


def test_nonsense_is_refused():
    for call in (
        lambda: multiple_power(1.0, 34, 4),
        lambda: multiple_power(0.3, 5, 4),
        lambda: paired_power(0.5, 1),
        lambda: smallest_multiple(34, 4, power=0.01),
    ):
        with pytest.raises(InvalidConfig):
            call()
