"""The study store when things go wrong: kill -9, full disks, locks, foreign and damaged files."""

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from steerlab.study.store import connection as store_connection
from steerlab.study.store.connection import connect, fail
from steerlab.study.store.errors import StoreError
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore

WRITER = """
import sys
from pathlib import Path
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.study.store.store import StudyStore
from steerlab.study.store.records import StoredRollout
from steerlab.sim.world import WorldSpec

world = WorldSpec(name="w", ball_xy_m=(9.0, 0.0), start=Pose2D(-9.0, 0.0, 0.0))
store = StudyStore.create(Path(sys.argv[1]))
store.add_participant("P01", "seen")
store.add_rollout(StoredRollout(name="r0", world=world, control_hz=10.0, seed=0, steps=50))
while True:
    attempt = store.begin_attempt("P01", "r0")
    for step in range(50):
        store.append(LabelledStep(
            participant="P01", rollout="r0", attempt=attempt.attempt, step=step, t_s=step / 10,
            x_m=0.0, y_m=0.0, heading_rad=0.0, speed_mps=0.0, lateral_speed_mps=0.0, yaw_rate_radps=0.0,
            acceleration_x_mps2=0.0, acceleration_y_mps2=0.0, robot_wheel=0.0,
            teacher_label=float(step), oracle_label=None, executed_wheel=0.0, gate=Driver.ROBOT,
            label_valid=True,
        ))
        print("step", attempt.attempt, step, flush=True)
    store.finish_attempt(attempt)
    print("finished", attempt.attempt, flush=True)
"""


@pytest.mark.parametrize("kill_after_lines", [3, 137])
def test_kill_9_loses_nothing_that_was_acknowledged(tmp_path: Path, kill_after_lines: int):
    path = tmp_path / "study.db"
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert writer.stdout is not None
    told = [writer.stdout.readline() for _ in range(kill_after_lines)]
    os.kill(writer.pid, signal.SIGKILL)
    told += writer.stdout.readlines()
    writer.stdout.close()
    assert writer.wait() == -signal.SIGKILL

    whole = [line.split() for line in told if line.endswith("\n")]
    finished = [int(words[1]) for words in whole if words[0] == "finished"]
    steps = {(int(words[1]), int(words[2])) for words in whole if words[0] == "step"}
    with StudyStore.open(path) as store:
        by_status = {
            status: [a.attempt for a in store.attempts(status)] for status in AttemptStatus
        }
        kept = store.read_labels([*AttemptStatus])
        labels = store.read_labels([AttemptStatus.FINISHED])
        for attempt in store.attempts(AttemptStatus.RUNNING):
            store.abandon_attempt(attempt, "redo")  # what a resumed session does
        redo = store.begin_attempt("P01", "r0")
    at = set(zip(kept.column("attempt").to_pylist(), kept.column("step").to_pylist(), strict=True))
    assert steps <= at
    assert set(finished) <= set(by_status[AttemptStatus.FINISHED])
    assert labels.num_rows == 50 * len(by_status[AttemptStatus.FINISHED])
    assert len(by_status[AttemptStatus.RUNNING]) <= 1
    assert redo.attempt == sum(map(len, by_status.values()))


def test_an_unfinished_attempt_is_flagged_after_kill_9(tmp_path: Path):
    path = tmp_path / "study.db"
    endless = WRITER.replace("store.finish_attempt(attempt)", "sys.stdin.read()")
    writer = subprocess.Popen(
        [sys.executable, "-c", endless, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert writer.stdin is not None
    assert writer.stdout is not None
    for _ in range(50):
        writer.stdout.readline()
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    writer.stdin.close()
    writer.stdout.close()
    with StudyStore.open(path) as store:
        assert [a.status for a in store.attempts()] == [AttemptStatus.RUNNING]
        assert store.read_labels().num_rows == 0
        assert store.read_labels([AttemptStatus.RUNNING]).num_rows == 50


def test_a_missing_file_is_told(tmp_path: Path):
    with pytest.raises(StoreError, match="no study database at"):
        StudyStore.open(tmp_path / "study.db")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(StoreError, match="no study database at"):
        StudyStore.open(tmp_path)


def test_creating_never_overwrites(tmp_path: Path):
    path = tmp_path / "study.db"
    StudyStore.create(path).close()
    with pytest.raises(StoreError, match="exists already"):
        StudyStore.create(path)
    with pytest.raises(StoreError, match="check that its folder exists"):
        StudyStore.create(tmp_path / "nowhere" / "study.db")


def test_a_clean_close_leaves_one_file(tmp_path: Path):
    StudyStore.create(tmp_path / "study.db").close()
    assert [path.name for path in tmp_path.iterdir()] == ["study.db"]


def test_a_failed_creation_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(store_connection, "SCHEMA", "CREATE TABEL oops;")
    with pytest.raises(StoreError, match="Cannot make a study"):
        StudyStore.create(tmp_path / "study.db")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"name,label\nP01,0.5\n" * 99, b"SQLite format 3\x00"])
def test_a_file_that_is_no_database_is_told(tmp_path: Path, content: bytes):
    path = tmp_path / "study.db"
    path.write_bytes(content)
    with pytest.raises(StoreError, match=r"not a SQLite file|not one that steerlab made"):
        StudyStore.open(path)
    assert path.read_bytes() == content


def test_a_foreign_database_is_told_and_left_alone(tmp_path: Path):
    path = tmp_path / "study.db"
    other = sqlite3.connect(path)
    other.execute("CREATE TABLE meta (key, value)")
    other.commit()
    other.close()
    before = path.read_bytes()
    with pytest.raises(StoreError, match="not one that steerlab made"):
        StudyStore.open(path)
    assert path.read_bytes() == before


def test_a_damaged_file_is_told(tmp_path: Path):
    path = tmp_path / "study.db"
    StudyStore.create(path).close()
    content = bytearray(path.read_bytes())
    content[100:4096] = bytes(3996)
    path.write_bytes(content)
    with pytest.raises(StoreError, match="restore the study folder"):
        StudyStore.open(path)


def test_a_lock_names_its_mend(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(store_connection, "BUSY_TIMEOUT_S", 0.05)
    path = tmp_path / "study.db"
    with StudyStore.create(path) as store:
        store.add_participant("P01", "seen")
        other = connect(path, read_only=False)
        try:
            other.execute("BEGIN IMMEDIATE")
            with pytest.raises(StoreError, match="locked; another program holds it"):
                store.add_participant("P02", "seen")
            with pytest.raises(StoreError, match=r"Cannot open the study .*another program"):
                StudyStore.open(path)
            with StudyStore.open(path, read_only=True) as reader:
                assert reader.participants() == {"P01": "seen"}
        finally:
            other.close()
        store.add_participant("P02", "seen")


def test_a_reader_cannot_write(tmp_path: Path):
    path = tmp_path / "study.db"
    StudyStore.create(path).close()
    with (
        StudyStore.open(path, read_only=True) as store,
        pytest.raises(StoreError, match="readonly database; make the file"),
    ):
        store.add_participant("P01", "seen")


def test_a_full_disk_keeps_what_was_stored(tmp_path: Path):
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant("P01", "seen")
        store.connection.run("PRAGMA max_page_count = 1")  # SQLite's own way to be full
        with pytest.raises(StoreError, match="full; free some room"):
            store.add_participant("P02" * 20_000, "seen")
        assert store.participants() == {"P01": "seen"}


def test_an_error_keeps_sqlites_own_words(tmp_path: Path):
    with pytest.raises(StoreError, match=r"Cannot read in .*: odd\.$"):
        fail(tmp_path, "read", sqlite3.Error("odd"))


def test_an_exception_inside_the_block_still_closes(tmp_path: Path):
    with pytest.raises(RuntimeError), StudyStore.create(tmp_path / "study.db") as store:
        raise RuntimeError
    with pytest.raises(StoreError, match="closed"):
        store.participants()
    with pytest.raises(StoreError, match="closed"):
        store.record("consent", "version 3")


@contextmanager
def _nothing_can_be_written(folder: Path) -> Iterator[None]:
    """As on a read-only medium; root, whom modes do not stop, becomes nobody meanwhile."""
    root = os.geteuid() == 0
    modes = {one: one.stat().st_mode & 0o7777 for one in folder.parents if root}
    parents = {one: mode for one, mode in modes.items() if mode & 0o011 != 0o011}
    for path in folder.iterdir():
        path.chmod(0o444)
    folder.chmod(0o555)
    try:
        if root:
            for one, mode in parents.items():  # pytest's folders let nobody else through
                one.chmod(mode | 0o011)
            os.seteuid(65534)
        yield
    finally:
        if root:
            os.seteuid(0)
            for one, mode in parents.items():
                one.chmod(mode)
        for path in folder.iterdir():
            path.chmod(0o644)
        folder.chmod(0o755)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes say nothing here")
def test_a_store_on_a_read_only_medium_can_be_read(tmp_path: Path):
    folder = tmp_path / "disc"
    folder.mkdir()
    path = folder / "study.db"
    with StudyStore.create(path) as store:
        store.add_participant("P01", "seen")
    with _nothing_can_be_written(folder):
        with StudyStore.open(path, read_only=True) as reader:
            assert reader.participants() == {"P01": "seen"}
        with pytest.raises(StoreError, match="writable"):
            StudyStore.open(path)
    assert [one.name for one in folder.iterdir()] == ["study.db"]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes say nothing here")
def test_what_is_still_in_the_log_is_not_passed_over(tmp_path: Path):
    live, copy = tmp_path / "live", tmp_path / "copy"
    live.mkdir()
    copy.mkdir()
    StudyStore.create(live / "study.db").close()
    with StudyStore.open(live / "study.db") as store:
        store.add_participant("P01", "seen")
        for name in ("study.db", "study.db-wal"):
            shutil.copy(live / name, copy / name)
    with (
        _nothing_can_be_written(copy),
        pytest.raises(StoreError, match=r"kept last is in study.db-wal.*Copy the whole folder"),
    ):
        StudyStore.open(copy / "study.db", read_only=True)
    with StudyStore.open(copy / "study.db", read_only=True) as reader:
        assert reader.participants() == {"P01": "seen"}


def test_a_copy_without_its_log_says_what_is_missing(tmp_path: Path):
    live, copy = tmp_path / "live.db", tmp_path / "study.db"
    with StudyStore.create(live):
        shutil.copy(live, copy)  # all that was kept is in live.db-wal still
    for read_only in (True, False):
        with pytest.raises(StoreError, match=r"copied without study.db-wal.*copy the whole folder"):
            StudyStore.open(copy, read_only=read_only)
