"""The quick verbs with too little disk, file size or handles; `make soak` tries every verb, often."""

import sys

import pytest

from tests.faults.kills import VERBS
from tests.faults.scarcity import Scarce, Trial, no_small_disk, prepared, try_in_turn

TOO_LITTLE = (
    ("power", Scarce.DISK, 40_000),
    ("study new", Scarce.DISK, 60_000),
    ("study new", Scarce.FILE_SIZE, 60_000),
    ("study run", Scarce.DISK, 1_420_000),  # in the middle of a drive
    ("study new", Scarce.HANDLES, 40),
    ("erase", Scarce.FILE_SIZE, 60_000),
)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits are set as POSIX has them")
@pytest.mark.parametrize(("name", "scarce", "amount"), TOO_LITTLE)
def test_what_runs_out_is_said_nothing_is_half_and_the_same_command_finishes(
    name, scarce, amount, tmp_path
):
    if scarce is Scarce.DISK and (why := no_small_disk()):
        pytest.skip(why)
    (verb,) = (verb for verb in VERBS if verb.name == name)
    trial = Trial(scarce=scarce, amount=amount)
    assert try_in_turn(verb, [trial], prepared(verb, tmp_path), tmp_path / "run") == ([2], [])
