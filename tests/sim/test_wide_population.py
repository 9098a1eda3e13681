import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import sample_population
from steerlab.sim.wide_population import WIDE, sample_wide


def test_gain_and_delay_fill_their_ranges_and_the_rest_is_human():
    people = sample_wide(400, 5, prefix="x")
    gains = np.log([one.style.gain for one in people])
    delays_s = np.array([one.style.delay_s for one in people])
    for values, (low, high) in ((gains, np.log(WIDE.gain)), (delays_s, WIDE.delay_s)):
        assert low <= values.min()
        assert values.max() <= high
        shares = np.histogram(values, bins=4, range=(low, high))[0] / len(values)
        assert shares == pytest.approx(0.25, abs=0.07)
    human = sample_population("human", 400, 5, prefix="x")
    assert [one.style.lag_s for one in people] == [one.style.lag_s for one in human]
    assert [one.seed for one in people] == [one.seed for one in human]


def test_the_first_do_not_change_and_groups_are_independent():
    assert sample_wide(5, 0, prefix="a")[:3] == sample_wide(3, 0, prefix="a")
    seen, test = sample_wide(3, 0, prefix="seen"), sample_wide(3, 0, prefix="test")
    assert [one.style.gain for one in seen] != [one.style.gain for one in test]
    assert sample_wide(3, 1, prefix="a") != sample_wide(3, 0, prefix="a")


def test_nobody_is_no_population():
    with pytest.raises(InvalidConfig):
        sample_wide(0, 0, prefix="a")
