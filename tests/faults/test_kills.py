"""Verbs that write, killed a few times each at random moments; `make soak` kills them often."""

import pytest

from tests.faults.kills import VERBS, kill_often

KILLS, OF_SLOW_ONES = 3, 1
SLOW = ("simulate", "fit", "calibration-set", "teach")


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.name)
def test_nothing_is_half_and_the_same_command_finishes(verb, tmp_path):
    kills = OF_SLOW_ONES if verb.name in SLOW else KILLS
    assert kill_often(verb, tmp_path, kills, seed=1).broken == []
