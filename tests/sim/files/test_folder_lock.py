"""The lock on a study's folder."""

import os
import subprocess
import sys
from threading import Thread

import pytest

from steerlab.sim.files.folder_lock import CONSOLE_LOCK, RUN_LOCK, LockedOut, locked

HOLDER = """
import sys
from pathlib import Path
from steerlab.sim.files.folder_lock import locked

with locked(Path(sys.argv[1]), "run.lock", "runs"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the run lock of ``tmp_path``."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


def test_the_second_is_told_who_the_first_is(tmp_path):
    """In one process too: filelock's own locks may be taken again by whoever holds them."""
    with locked(tmp_path, RUN_LOCK, "runs"):
        again = locked(tmp_path, RUN_LOCK, "runs")
        with pytest.raises(LockedOut, match=f"already: process {os.getpid()}") as refused, again:
            pytest.fail("held twice")
        assert refused.value.pid == os.getpid()
        with locked(tmp_path, CONSOLE_LOCK, "serves"):
            pass
    with locked(tmp_path, RUN_LOCK, "runs"):
        assert (tmp_path / "run.pid").read_text() == f"{os.getpid()}\n"


def test_another_process_is_told_as_well_and_changes_nothing(tmp_path, holder):
    for _ in range(2):
        again = locked(tmp_path, RUN_LOCK, "runs")
        with pytest.raises(LockedOut, match=f"already: process {holder.pid}") as refused, again:
            pytest.fail("held twice")
        assert refused.value.pid == holder.pid


def test_a_dead_process_holds_nothing(tmp_path, holder):
    holder.kill()
    holder.wait()
    assert (tmp_path / "run.pid").read_text() == f"{holder.pid}\n"
    with locked(tmp_path, RUN_LOCK, "runs"):
        assert (tmp_path / "run.pid").read_text() == f"{os.getpid()}\n"


def test_another_thread_is_refused_and_may_let_go(tmp_path):
    """The console works in several threads, and an exit stack may be closed in any of them."""
    lock = locked(tmp_path, RUN_LOCK, "runs")
    lock.__enter__()
    refused = []

    def take_then_let_go() -> None:
        try:
            locked(tmp_path, RUN_LOCK, "runs").__enter__()
        except LockedOut as error:
            refused.append(error)
        lock.__exit__(None, None, None)

    thread = Thread(target=take_then_let_go)
    thread.start()
    thread.join()
    assert len(refused) == 1
    with locked(tmp_path, RUN_LOCK, "runs"):
        pass


def test_it_is_let_go_when_the_block_fails(tmp_path):
    with pytest.raises(RuntimeError), locked(tmp_path, RUN_LOCK, "runs"):
        raise RuntimeError
    with locked(tmp_path, RUN_LOCK, "runs"):
        pass


def test_a_holder_that_did_not_say_is_still_one(tmp_path, holder):
    (tmp_path / "run.pid").unlink()
    with (
        pytest.raises(LockedOut, match=r"runs .* already\. Close it") as refused,
        locked(tmp_path, RUN_LOCK, "runs"),
    ):
        pytest.fail("held twice")
    assert refused.value.pid is None


def test_a_folder_that_is_missing_is_not_made(tmp_path):
    with pytest.raises(FileNotFoundError), locked(tmp_path / "none", RUN_LOCK, "runs"):
        pytest.fail("made a folder")
    assert list(tmp_path.iterdir()) == []
