"""An older but whole copy of the database is told by the newest audit entry, named beside it."""

import shutil
from pathlib import Path

import pytest

from steerlab.study.contract import Role
from steerlab.study.store.errors import StoreError
from steerlab.study.study import Study

HEAD_FILE = "study.db-head"


@pytest.fixture
def stale(study, folder, tmp_path) -> Path:
    """A copy of all but the log, while the study is open."""
    study.enrol(Role.TRAINING)
    study._opened.store.connection.run("PRAGMA wal_checkpoint(TRUNCATE)")
    study.enrol(Role.TRAINING)
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("*-wal", "*-shm"))
    return copy


def test_nobody_goes_on_from_an_older_copy_unknowingly(stale):
    with pytest.raises(StoreError, match=r"older or another copy: entry \d+.*without study.db-wal"):
        Study.open(stale)
    (stale / HEAD_FILE).unlink()  # as the message says
    with Study.open(stale) as study:
        assert study.enrol(Role.TRAINING).id == "T002"
        assert study.verify().ok


def test_an_older_copy_can_be_looked_at_and_is_told(stale, caplog):
    with Study.open(stale, read_only=True) as study:
        assert "older or another copy" in caplog.text
        (check,) = [one for one in study.verify().findings if one.what == "Database"]
    assert not check.ok
    assert "Close every program and copy the whole folder again" in check.mend


def test_a_whole_copy_is_no_older_one(study, folder, tmp_path, caplog):
    study.enrol(Role.TRAINING)
    shutil.copytree(folder, tmp_path / "copy")
    with Study.open(tmp_path / "copy") as copy:
        assert [one.id for one in copy.participants()] == ["T001"]
        assert copy.verify().ok
    assert not caplog.text


@pytest.mark.parametrize("left", [b"", b"0" * 90, b"\xff\x00"])
def test_what_a_power_cut_left_of_the_sign_is_no_sign(study, folder, left):
    study.enrol(Role.TRAINING)
    study.close()
    (folder / HEAD_FILE).write_bytes(left)
    with Study.open(folder) as again:
        assert again.verify().ok
        again.enrol(Role.TRAINING)
    assert (folder / HEAD_FILE).read_bytes()[20:21] == b" "
    with Study.open(folder) as again:
        assert again.verify().ok


def test_a_sign_that_cannot_be_written_costs_nothing_that_is_kept(study, folder):
    (folder / HEAD_FILE).mkdir()
    assert study.enrol(Role.TRAINING).id == "T001"
    assert study.verify().ok


def test_whoever_reads_while_others_write_sees_no_older_copy(study, folder, caplog):
    for _ in range(20):
        study.enrol(Role.TRAINING)
        with Study.open(folder, read_only=True) as reader:
            assert reader.verify().ok
    assert not caplog.text
