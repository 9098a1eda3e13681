"""``study backup``: a consistent, private copy while others write, and nothing else replaced."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import pytest

from steerlab.app.cli import main
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.study import backup as backup_module
from steerlab.study.backup import backup
from steerlab.study.contract import Role, StudyError
from steerlab.study.derived import ErasedMeanwhile
from steerlab.study.store.people import Departure, erase_rows, read_departures
from steerlab.study.store.store import StudyStore
from steerlab.study.study import Study
from tests.study.conftest import make_small


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def content(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in files(folder)}


def head(folder: Path) -> str:
    with Study.open(folder, read_only=True) as study:
        return study.verify().head


def test_the_copy_is_whole_and_its_owners_alone(trained, tmp_path):
    (trained / "recordings").mkdir(exist_ok=True)
    (trained / "recordings" / "T001-calibration-05-0.rrd").write_bytes(b"RRF")
    (trained / "models").mkdir(exist_ok=True)
    (trained / "models" / "analysis-1.safetensors").write_bytes(b"x")
    (trained / "models" / "mind_meld-1.safetensors").write_bytes(b"network")
    (trained / "notes.txt").write_text("mine")
    verified = backup(trained, tmp_path / "to" / "copy")
    copy = tmp_path / "to" / "copy"
    assert files(copy) == ["models/mind_meld-1.safetensors", "study.db", "study.toml"]
    assert verified.ok
    assert verified.head == head(trained)
    assert copy.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in copy.rglob("*") if path.is_file()} == {0o600}
    assert (copy / "models").stat().st_mode & 0o777 == 0o700
    with Study.open(copy) as study:  # it is a study like any other
        assert study.enrol(Role.TRAINING).id == "T003"


def test_a_full_disk_is_said_as_one_and_leaves_no_copy(trained, tmp_path, monkeypatch):
    (trained / "models").mkdir(exist_ok=True)
    (trained / "models" / "mind_meld-1.safetensors").write_bytes(b"network")

    def full(source, target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, "copyfile", full)
    (trained / "study.toml").rename(tmp_path / "study.toml")  # copied apart from the folders
    with pytest.raises(SteerlabError, match=r"No space left on device; make room"):
        backup(trained, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()


def test_what_can_be_made_anew_comes_only_if_asked_for(trained, tmp_path):
    for name in ("recordings", "report", "exports"):
        (trained / name).mkdir(exist_ok=True)
        (trained / name / "one").write_bytes(b"1")
    (trained / "models").mkdir(exist_ok=True)
    (trained / "models" / "analysis-1.safetensors").write_bytes(b"x")
    (trained / "models" / ".mind_meld-abc.part").mkdir()
    backup(trained, tmp_path / "copy", derived=True)
    more = ["exports/one", "models/analysis-1.safetensors", "recordings/one", "report/one"]
    assert files(tmp_path / "copy") == [*more, "study.db", "study.toml"]


def test_it_is_consistent_while_another_program_writes(trained, tmp_path):
    """A run holds the study's lock and writes on; each copy is whole, and a state that was."""
    stop, began = Event(), Event()

    def write() -> None:
        with Study.open(trained) as study, locked(trained, RUN_LOCK, "runs"):
            while not stop.is_set():
                study.note("T001", "still here")
                began.set()

    writer = Thread(target=write)
    writer.start()
    try:
        assert began.wait(30.0)
        lengths = []
        for _ in range(4):
            assert backup(trained, tmp_path / "copy").ok
            with StudyStore.open(tmp_path / "copy" / "study.db") as store:
                notes = store.connection.read("SELECT count(*) FROM notes")[0][0]
                acts = [entry.act for entry in store.audit()]
                assert acts.count("note kept") == notes
                lengths.append(len(acts))
    finally:
        stop.set()
        writer.join()
    assert lengths == sorted(lengths)
    with Study.open(trained) as study:
        assert study.verify().ok


def test_an_earlier_backup_is_replaced_by_a_later_one(trained, tmp_path):
    first = backup(trained, tmp_path / "copy").head
    with Study.open(trained) as study:
        study.note(None, "later")
    second = backup(trained, tmp_path / "copy").head
    assert second != first
    assert head(tmp_path / "copy") == second
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy", "trained"]


def test_a_study_in_which_nothing_has_happened_is_copied_too(folder, tmp_path):
    for _ in range(2):
        assert backup(folder, tmp_path / "copy").head == ""
    with Study.open(folder) as study:
        study.enrol(Role.TRAINING)
    backup(folder, tmp_path / "copy")
    with pytest.raises(StudyError, match="holds another study"):
        backup(make_small(tmp_path / "other"), tmp_path / "copy")


def test_what_is_no_earlier_backup_of_the_study_stays(trained, tmp_path):
    other = make_small(tmp_path / "other")
    with Study.open(other) as study:
        study.enrol(Role.TRAINING)
    backup(other, tmp_path / "copy")
    before = content(tmp_path / "copy")
    with pytest.raises(StudyError, match="copy holds another study"):
        backup(trained, tmp_path / "copy")
    assert content(tmp_path / "copy") == before

    (mine := tmp_path / "mine").mkdir()
    (mine / "letter.txt").write_text("x")
    with pytest.raises(StudyError, match="holds no backup of a study"):
        backup(trained, mine)
    assert files(mine) == ["letter.txt"]

    backup(trained, tmp_path / "good")
    (tmp_path / "good" / "letter.txt").write_text("x")
    with pytest.raises(StudyError, match=r"holds letter\.txt, which a new backup would remove"):
        backup(trained, tmp_path / "good")


def test_a_backup_that_is_newer_than_the_study_stays(trained, tmp_path):
    """Somebody restored an old copy: backing that up would lose what came after it."""
    old = Path(shutil.copytree(trained, tmp_path / "old"))
    with Study.open(trained) as study:
        study.note(None, "later")
    newest = backup(trained, tmp_path / "copy").head
    with pytest.raises(StudyError, match=r"in a state that .*old never had"):
        backup(old, tmp_path / "copy")
    assert head(tmp_path / "copy") == newest


@pytest.mark.parametrize("where", [".", "copies", "..", "models/copy"])
def test_a_copy_does_not_lie_in_the_study_nor_hold_it(trained, where):
    before = content(trained)
    with pytest.raises(StudyError, match="choose another folder"):
        backup(trained, trained / where)
    assert {name: raw for name, raw in content(trained).items() if name in before} == before


def test_nobody_is_copied_who_is_being_erased(trained, tmp_path, monkeypatch):
    real = backup_module.copy_study

    def meanwhile(study, target, **how):
        real(study, target, **how)
        with Study.open(trained) as other:
            other.withdraw("T001", erase=True)

    monkeypatch.setattr(backup_module, "copy_study", meanwhile)
    with pytest.raises(ErasedMeanwhile, match="T001 were erased while this ran"):
        backup(trained, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
    monkeypatch.undo()
    with StudyStore.open(trained / "study.db") as store:
        erase_rows(store.connection, "T002")
        assert read_departures(store.connection)["T002"] is Departure.ERASING
    with pytest.raises(StudyError, match=r"erasure of T002 is not finished.*T002 --erase"):
        backup(trained, tmp_path / "copy")


def test_a_damaged_study_does_not_replace_a_good_copy(trained, tmp_path):
    before = backup(trained, tmp_path / "copy").head
    with StudyStore.open(trained / "study.db") as store:
        sqlite = store.connection.sqlite
        sqlite.execute("DROP TRIGGER update_of_audit")
        sqlite.execute("UPDATE audit SET detail = 'x' WHERE id = 2")
    with pytest.raises(StudyError, match=r"is damaged, so the earlier backup .* stays"):
        backup(trained, tmp_path / "copy")
    assert head(tmp_path / "copy") == before
    assert not backup(trained, tmp_path / "damaged").ok  # kept apart, and told


FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from steerlab.app.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("size", [10_000, 200_000])
def test_a_disk_that_takes_no_more_leaves_the_earlier_copy(trained, tmp_path, size):
    resource = pytest.importorskip("resource")
    assert resource is not None
    before = backup(trained, tmp_path / "copy").head
    with Study.open(trained) as study:
        study.note(None, "later")
    command = [sys.executable, "-B", "-c", FULL, str(size)]
    command += ["study", "backup", str(trained), str(tmp_path / "copy")]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 2, done
    assert "ulimit -f" in done.stderr
    assert "Traceback" not in done.stderr
    assert head(tmp_path / "copy") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy", "trained"]


def test_the_command_prints_the_head(trained, tmp_path, capsys):
    assert main(["study", "backup", str(trained), str(tmp_path / "copy")]) == 0
    said = capsys.readouterr().out
    assert f"Head of the audit (keep it elsewhere): {head(trained)}" in said
    assert main(["study", "backup", str(tmp_path), str(tmp_path / "b")]) == 2
    assert "There is no study in" in capsys.readouterr().err
