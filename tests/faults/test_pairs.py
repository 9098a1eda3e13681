"""Some pairs of commands that meet once on one study; `make soak` lets all of them meet often."""

import pytest

from tests.faults.pairs import PAIRS, meet_often

TELLING = (
    "two runs of one person",
    "run and erase the same",
    "analyze and erase",
    "console and erase",
)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return tmp_path_factory.mktemp("pairs")


@pytest.mark.slow
@pytest.mark.parametrize("name", TELLING)
def test_both_end_well_or_in_a_sentence_and_nothing_is_lost(name, room):
    (pair,) = (pair for pair in PAIRS if pair.name == name)
    assert meet_often(pair, room, 1, seed=1).broken == []
