"""Files that another steerlab made are refused in one sentence, and left as they are."""

import sqlite3
from pathlib import Path

import pytest

from steerlab.study.store import connection as store_connection
from steerlab.study.store.connection import connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.schema import APPLICATION_ID, STORE_VERSION
from steerlab.study.store.store import StudyStore


@pytest.fixture
def path(tmp_path: Path) -> Path:
    StudyStore.create(tmp_path / "study.db").close()
    return tmp_path / "study.db"


def change(path: Path, *statements: str) -> None:
    other = connect(path, read_only=False)
    for statement in statements:
        other.execute(statement)
    other.close()


def refusals(path: Path) -> set[str]:
    """What opening says, for reading and for writing; the file stays as it is."""
    before = path.read_bytes()
    said: set[str] = set()
    for read_only in (True, False):
        with pytest.raises(StoreError) as refused:
            StudyStore.open(path, read_only=read_only)
        said.add(str(refused.value))
    assert path.read_bytes() == before
    return said


@pytest.mark.parametrize("version", ["0", str(STORE_VERSION + 1), "4", "x", ""])
def test_another_version_is_refused_in_one_sentence(path: Path, version: str):
    change(
        path,
        f"UPDATE meta SET value = '{version}' WHERE key = 'schema_version'",
        "UPDATE meta SET value = 'steerlab 0.0.9' WHERE key = 'created_by'",
    )
    (said,) = refusals(path)
    assert said.startswith(
        f"{path} was made by another version of steerlab (steerlab 0.0.9, schema version "
        f"{version}), and this one (steerlab "
    )
    assert f", schema version {STORE_VERSION}) cannot read it: open it with the steerlab" in said
    assert said.endswith("formats that were never released are not converted.")
    assert ". " not in said


def test_a_file_that_says_no_version_is_refused(path: Path):
    change(path, "DELETE FROM meta")
    (said,) = refusals(path)
    assert "another version of steerlab (unknown, schema version none), and" in said


@pytest.mark.parametrize(
    ("statement", "lacks"),
    [
        ("ALTER TABLE responses RENAME COLUMN phase_run TO round", "responses.phase_run"),
        ("DROP TABLE erasing", "erasing.participant"),
    ],
)
def test_an_unreleased_schema_of_the_same_number_is_refused(path: Path, statement: str, lacks: str):
    change(path, statement)
    (said,) = refusals(path)
    assert f", schema version {STORE_VERSION} without {lacks}), and this one" in said


def test_the_first_steerlabs_files_are_refused(tmp_path: Path):
    """They said version 1, too, and had six tables."""
    raw = sqlite3.connect(tmp_path / "study.db")
    raw.executescript(
        f"PRAGMA application_id = {APPLICATION_ID};"
        "CREATE TABLE meta (key TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL) STRICT;"
        "CREATE TABLE participants (pseudonym TEXT NOT NULL PRIMARY KEY, role TEXT NOT NULL);"
        "INSERT INTO meta VALUES ('schema_version', '1'), ('created_by', 'steerlab 0.1.0');"
    )
    raw.close()
    (said,) = refusals(tmp_path / "study.db")
    assert "(steerlab 0.1.0, schema version 1 without attempts.attempt), and" in said


def test_what_somebody_added_does_no_harm(path: Path):
    change(path, "CREATE TABLE mine (x)", "CREATE INDEX faster ON steps (step)", "ANALYZE")
    StudyStore.open(path).close()


def test_a_schema_that_cannot_be_made_leaves_no_file(tmp_path: Path, monkeypatch):
    with monkeypatch.context() as patch:
        broken = f"{store_connection.SCHEMA} CREATE TABEL oops;"
        patch.setattr(store_connection, "SCHEMA", broken)
        with pytest.raises(StoreError, match="Cannot make a study"):
            StudyStore.create(tmp_path / "study.db")
    assert list(tmp_path.iterdir()) == []
