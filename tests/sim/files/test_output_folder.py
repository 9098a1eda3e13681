import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from steerlab.sim.files import output_folder as module
from steerlab.sim.files.output_folder import OutputError, exchange, output_folder


class Interrupted(Exception):
    pass


def _fail_after_writing(out, force=False):
    with output_folder(out, force=force) as folder:
        (folder / "a").write_text("1")
        raise Interrupted


def test_results_appear_whole(tmp_path):
    out = tmp_path / "deep" / "out"
    with output_folder(out) as folder:
        (folder / "a").write_text("1")
        assert not out.exists()
    assert (out / "a").read_text() == "1"
    assert os.listdir(out.parent) == ["out"]


def test_a_failure_leaves_nothing(tmp_path):
    with pytest.raises(Interrupted):
        _fail_after_writing(tmp_path / "out")
    assert os.listdir(tmp_path) == []


def test_a_full_folder_is_kept_unless_forced(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("precious")
    with pytest.raises(OutputError, match="--force"), output_folder(out):
        pass
    with pytest.raises(Interrupted):
        _fail_after_writing(out, force=True)
    assert (out / "old").read_text() == "precious"
    with output_folder(out, force=True) as folder:
        (folder / "new").write_text("1")
    assert os.listdir(out) == ["new"]
    assert os.listdir(tmp_path) == ["out"]


def test_an_empty_folder_is_used(tmp_path):
    with output_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
    (tmp_path / "out" / "a").unlink()
    with output_folder(tmp_path / "out") as folder:
        (folder / "b").write_text("1")
    assert os.listdir(tmp_path / "out") == ["b"]


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"), output_folder(tmp_path / "file"):
        pass
    with pytest.raises(OutputError, match="Cannot write"), output_folder(tmp_path / "file" / "out"):
        pass


def test_a_full_disk_is_said_and_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match="No space left"), output_folder(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert os.listdir(tmp_path) == []


def _refuse_to_rename(path, error, monkeypatch):
    rename = os.rename

    def refuse(source, target, **rest):
        if os.fspath(source) == os.fspath(path):
            raise OSError(error, os.strerror(error))
        rename(source, target, **rest)

    monkeypatch.setattr(os, "rename", refuse)


def test_folders_of_a_layered_file_system_are_replaced_too(tmp_path, monkeypatch):
    """There a folder of a lower layer cannot be renamed, as in many containers."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("1")
    _refuse_to_rename(out, errno.EXDEV, monkeypatch)
    monkeypatch.setattr(module, "exchange", lambda first, second: False)
    with output_folder(out, force=True) as folder:
        (folder / "new").write_text("1")
    assert os.listdir(out) == ["new"]
    assert os.listdir(tmp_path) == ["out"]


def test_two_folders_swap_their_names_at_once(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "was").write_text(name)
    assert exchange(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "a" / "was").read_text() == "b"
    assert (tmp_path / "b" / "was").read_text() == "a"
    assert not exchange(tmp_path / "a", tmp_path / "missing")


_KILLED = """
import os, signal, sys
from pathlib import Path
from steerlab.sim.files import output_folder as module
if sys.argv[2] != "here":
    module.exchange = lambda first, second: False
def kill(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)
if sys.argv[2] == "copying":  # a layered file system
    os.rename, module.shutil.rmtree = (lambda *_: (_ for _ in ()).throw(OSError(18, "x"))), kill
elif sys.argv[2] == "between":
    put = Path.rename
    Path.rename = lambda a, b: kill() if a.name == "new" else put(a, b)
with module.output_folder(Path(sys.argv[1]), force=True) as folder:
    (folder / "new").write_text("1")
    if sys.argv[2] == "here":
        kill()
"""


@pytest.mark.parametrize("where", ["here", "between", "copying"])
def test_a_killed_program_loses_no_results_and_leaves_nothing_for_long(tmp_path, where):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("precious")
    killed = subprocess.run([sys.executable, "-c", _KILLED, str(out), where], check=False)
    assert killed.returncode == -9
    assert len(os.listdir(tmp_path)) == (1 if where == "between" else 2)
    with pytest.raises(OutputError, match="--force"), output_folder(out):
        pass
    assert os.listdir(tmp_path) == ["out"]
    assert (out / "old").read_text() == "precious"


def test_a_link_stands_for_its_folder(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with output_folder(tmp_path / "link") as folder:
        (folder / "a").write_text("1")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "a").read_text() == "1"


@pytest.mark.parametrize("out", [".", ".."])
def test_the_folder_one_is_in_is_not_replaced(tmp_path, monkeypatch, out):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with (
        pytest.raises(OutputError, match="folder you are in"),
        output_folder(Path(out), force=True),
    ):
        pass


def test_results_that_came_meanwhile_are_not_replaced_unless_forced(tmp_path):
    out = tmp_path / "out"

    def write():
        with output_folder(out) as folder:
            (folder / "a").write_text("1")
            out.mkdir()
            (out / "other").write_text("2")

    with pytest.raises(OutputError, match="not empty"):
        write()
    assert os.listdir(out) == ["other"]
    assert os.listdir(tmp_path) == ["out"]


@pytest.mark.parametrize("error", [errno.EBUSY, errno.EACCES, errno.EPERM])
def test_what_cannot_be_replaced_is_said_before_the_work_and_stays(tmp_path, monkeypatch, error):
    """A mounted disk, as ``/out`` of a container, or somebody else's folder in a shared one."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("precious")
    worked = []
    _refuse_to_rename(out, error, monkeypatch)
    with (
        pytest.raises(OutputError, match=r"out cannot be replaced: .* a disk is mounted there"),
        output_folder(out, force=True),
    ):
        worked.append(True)
    assert not worked
    assert (out / "old").read_text() == "precious"
    assert os.listdir(tmp_path) == ["out"]


def test_what_becomes_unmovable_meanwhile_loses_nothing(tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("precious")
    _refuse_to_rename(out, errno.EBUSY, monkeypatch)
    monkeypatch.setattr(module, "_refuse_unmovable", lambda path, room: None)
    monkeypatch.setattr(module, "exchange", lambda first, second: False)
    with pytest.raises(OutputError, match="busy"), output_folder(out, force=True) as folder:
        (folder / "new").write_text("1")
    assert (out / "old").read_text() == "precious"
    assert os.listdir(tmp_path) == ["out"]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes say nothing here")
def test_a_folder_of_somebody_elses_in_a_shared_one_is_refused(tmp_path):
    """The real system's word for it, not a made-up one: a sticky folder, as /tmp is."""
    shared = tmp_path / "shared"
    (shared / "out").mkdir(parents=True)
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder to somebody else")
    above = {one: one.stat().st_mode & 0o7777 for one in (tmp_path, *tmp_path.parents)}
    for one, mode in above.items():  # pytest's folders let nobody else through
        one.chmod(mode | 0o011)
    shared.chmod(0o1777)
    os.seteuid(65534)
    try:
        with pytest.raises(OutputError, match="cannot be replaced"):
            module.check_output_folder(shared / "out")
    finally:
        os.seteuid(0)
        for one, mode in above.items():
            one.chmod(mode)
    assert os.listdir(shared) == ["out"]
