"""Verbs that write, killed at random moments; `make soak` kills all of them, and often."""

import pytest

from tests.faults.kills import VERBS, kill_often

SOAK_ONLY = ("demo", "fit", "synthetic")  # they write as `simulate` does


@pytest.mark.slow
@pytest.mark.parametrize(
    "verb", [verb for verb in VERBS if verb.name not in SOAK_ONLY], ids=lambda verb: verb.name
)
def test_nothing_is_half_and_the_same_command_finishes(verb, tmp_path):
    assert kill_often(verb, tmp_path, 2, seed=1).broken == []
