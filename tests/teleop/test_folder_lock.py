"""The lock on a study's folder."""

import os
import subprocess
import sys

import pytest

from steerlab.teleop.folder_lock import CONSOLE_LOCK, RUN_LOCK, LockedOut, locked

HOLDER = """
import sys
from pathlib import Path
from steerlab.teleop.folder_lock import locked

with locked(Path(sys.argv[1]), "run.lock", "runs"):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_the_second_is_told_who_the_first_is(tmp_path):
    with locked(tmp_path, RUN_LOCK, "runs"):
        again = locked(tmp_path, RUN_LOCK, "runs")
        with pytest.raises(LockedOut, match=f"already: process {os.getpid()}") as refused, again:
            pytest.fail("held twice")
        assert refused.value.pid == os.getpid()
        with locked(tmp_path, CONSOLE_LOCK, "serves"):
            pass
    with locked(tmp_path, RUN_LOCK, "runs"):
        assert (tmp_path / RUN_LOCK).read_text() == f"{os.getpid()}\n"


def test_a_dead_process_holds_nothing(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout.readline() == "held\n"
    holder.kill()
    holder.wait()
    holder.stdin.close()
    holder.stdout.close()
    assert (tmp_path / RUN_LOCK).read_text() == f"{holder.pid}\n"
    with locked(tmp_path, RUN_LOCK, "runs"):
        assert (tmp_path / RUN_LOCK).read_text() == f"{os.getpid()}\n"
