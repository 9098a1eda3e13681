"""Power curves and sample sizes: exact where the power is known."""

import numpy as np
import pytest
from scipy.stats import norm

from steerlab.analysis.power_study.report import PowerCurve
from steerlab.analysis.statistics.outcome import NotComputable

SIZES = (10, 20, 40, 80)


def curve(*rejected: int, studies: int = 1000) -> PowerCurve:
    return PowerCurve.of("a test", SIZES, rejected, [studies] * len(SIZES))


def test_shares_and_their_monte_carlo_error():
    found = curve(50, 500, 800, 1000)
    assert found.power.tolist() == [0.05, 0.5, 0.8, 1.0]
    assert found.error[1] == pytest.approx(np.sqrt(0.25 / 1000), rel=0.01)
    assert found.error[3] > 0.0


def test_the_sample_size_is_where_the_curve_gets_there():
    found = curve(50, 500, 800, 1000).people_for(0.8)
    assert found.people == 40
    assert 20 < found.low < 40 < found.high < 80
    assert not found.at_most


def test_it_finds_the_size_of_a_z_test():
    def power(n: float) -> float:
        return float(norm.cdf(0.3 * np.sqrt(n) - 1.96))

    sizes = (40, 60, 80, 100, 120, 140)
    rejected = [round(1e6 * power(n)) for n in sizes]
    needed = ((1.96 + norm.ppf(0.8)) / 0.3) ** 2
    found = PowerCurve.of("z", sizes, rejected, [10**6] * 6).people_for(0.8)
    assert found.people == pytest.approx(needed, abs=1.5)


def test_what_is_not_reached_is_never_extrapolated():
    found = curve(50, 100, 300, 700).people_for(0.8)
    assert isinstance(found, NotComputable)
    assert "0.70 with 80 people" in found.reason


def test_the_smallest_size_may_do():
    found = curve(900, 950, 990, 1000).people_for(0.8)
    assert (found.people, found.at_most) == (10, True)


def test_a_dip_by_chance_is_levelled():
    found = curve(100, 810, 790, 1000).people_for(0.8)
    assert found.people in (19, 20, 40)
    assert found.low <= found.people <= found.high


def test_values_are_plain():
    values = curve(50, 500, 800, 1000).values()
    assert values["people_for_80"]["people"] == 40
    assert values["power"] == [0.05, 0.5, 0.8, 1.0]
