"""Files that are whole or not there, and what is waited for."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from steerlab.sim.files import whole_file as files
from steerlab.sim.files.whole_file import rename_durably, sync_folder, whole_file


def test_a_file_appears_whole_and_replaces_its_older_self(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with whole_file(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
        assert part.parent.suffix == ".part"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_block_that_fails_leaves_all_as_it_was(tmp_path, error):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(type(error)):
        _fail(path, error)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    path = tmp_path / "a.txt"
    with whole_file(path) as one:
        one.write_text("one")
        with whole_file(path) as other:
            other.write_text("other")
        assert path.read_text() == "other"
        assert one.read_text() == "one"
    assert path.read_text() == "one"
    assert list(tmp_path.iterdir()) == [path]


_KILLED = """
import os, signal, sys
from pathlib import Path
from steerlab.sim.files.whole_file import whole_file
with whole_file(Path(sys.argv[1])) as part:
    part.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_writer_left_is_removed_by_the_next_one_for_the_same_file(tmp_path):
    path, namesake = tmp_path / "a.txt", tmp_path / "a.txt-b"
    for victim in (path, namesake):
        subprocess.run([sys.executable, "-c", _KILLED, str(victim)], check=False)
    assert len(list(tmp_path.iterdir())) == 2
    with whole_file(path) as part:
        part.write_text("whole")
    left = [found.name for found in tmp_path.iterdir() if found != path]
    assert len(left) == 1
    assert left[0].startswith(".a.txt-b-")


def test_a_workspace_that_is_taken_before_it_is_locked_is_made_again(tmp_path, monkeypatch):
    """Its lock's file is there a moment before it is locked, and another program may come by."""
    path, real, taken = tmp_path / "a.txt", files.FileLock.acquire, []

    def acquire(lock, *arguments):
        if len(taken) < 2:  # the other program's own lock is the second
            taken.append(lock)
            for room in files.abandoned(path) if len(taken) == 1 else ():
                shutil.rmtree(room)
        return real(lock, *arguments)

    monkeypatch.setattr(files.FileLock, "acquire", acquire)
    with whole_file(path) as part:
        part.write_text("new")
    assert len(taken) == 2
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("names", [(), ("owner.lock",), ("a.txt",), ("owner.lock", "a.txt")])
def test_what_is_left_when_a_removal_was_cut_off_is_removed_by_the_next(tmp_path, names):
    room = tmp_path / ".a.txt-x_1.part"
    room.mkdir()
    for name in names:
        (room / name).touch()
    with whole_file(tmp_path / "a.txt") as part:
        part.write_text("new")
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


def _fail(path: Path, error: BaseException) -> None:
    with whole_file(path) as part:
        part.write_text("half")
        raise error


def _refuse(*_: object, **__: object) -> None:
    raise PermissionError(13, "in use by another process")


def test_a_file_that_was_not_written_is_told(tmp_path):
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "a.txt"):
        pass


def test_the_content_is_on_the_disk_before_the_name_and_the_name_before_it_returns(
    tmp_path, monkeypatch
):
    synced = []

    def fsync(handle: int) -> None:
        kind = "folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file"
        synced.append((kind, (tmp_path / "a").exists()))

    monkeypatch.setattr(files.os, "fsync", fsync)
    (tmp_path / "part").write_text("x")
    rename_durably(tmp_path / "part", tmp_path / "a")
    assert synced == [("file", False), ("folder", True)]


def test_what_is_flushed_may_be_written_as_windows_wants_it(tmp_path, monkeypatch):
    def fsync(handle: int) -> None:
        if not stat.S_ISDIR(os.fstat(handle).st_mode):
            os.write(handle, b"")

    monkeypatch.setattr(files.os, "fsync", fsync)
    (tmp_path / "part").write_text("x")
    rename_durably(tmp_path / "part", tmp_path / "a")


def test_a_folder_that_no_system_call_opens_is_left_alone(tmp_path, monkeypatch):
    monkeypatch.delattr(files.os, "O_DIRECTORY")
    monkeypatch.setattr(files.os, "open", _refuse)
    sync_folder(tmp_path)


def test_a_folder_that_may_not_be_read_is_told(tmp_path, monkeypatch):
    """It is Windows alone that is let off."""
    monkeypatch.setattr(files.os, "open", _refuse)
    with pytest.raises(PermissionError):
        sync_folder(tmp_path)
