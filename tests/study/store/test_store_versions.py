"""Files of the first schema version: read as they are, upgraded once when they are written to."""

import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep, step_from_row
from steerlab.sim.world import WorldSpec
from steerlab.study.store import schema as store_schema
from steerlab.study.store.events import TIMING_SCHEMA
from steerlab.study.store.records import Attempt, AttemptStatus, StoredRollout
from steerlab.study.store.schema import STORE_VERSION, StoreError
from steerlab.study.store.store import StudyStore

# As steerlab 0.1.0 wrote it, word for word; never edited.
VERSION_1 = """
PRAGMA application_id = 1398033474;
CREATE TABLE meta (key TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE participants (pseudonym TEXT NOT NULL PRIMARY KEY, role TEXT NOT NULL) STRICT;
CREATE TABLE rollouts (
    name TEXT NOT NULL PRIMARY KEY, world TEXT NOT NULL, control_hz REAL NOT NULL,
    seed INTEGER NOT NULL, steps INTEGER NOT NULL CHECK (steps > 0)
) STRICT;
CREATE TABLE attempts (
    participant TEXT NOT NULL REFERENCES participants (pseudonym),
    rollout TEXT NOT NULL REFERENCES rollouts (name),
    attempt INTEGER NOT NULL CHECK (attempt >= 0),
    status TEXT NOT NULL CHECK (status IN ('running', 'finished', 'abandoned')),
    order_index INTEGER NOT NULL CHECK (order_index >= 0),
    PRIMARY KEY (participant, rollout, attempt),
    UNIQUE (participant, order_index)
) STRICT;
CREATE TABLE steps (
    participant TEXT NOT NULL, rollout TEXT NOT NULL, attempt INTEGER NOT NULL,
    step INTEGER NOT NULL, t_s REAL NOT NULL, x_m REAL NOT NULL, y_m REAL NOT NULL,
    heading_rad REAL NOT NULL, speed_mps REAL NOT NULL, lateral_speed_mps REAL NOT NULL,
    yaw_rate_radps REAL NOT NULL, acceleration_x_mps2 REAL NOT NULL,
    acceleration_y_mps2 REAL NOT NULL, robot_wheel REAL NOT NULL, teacher_label REAL,
    oracle_label REAL, executed_wheel REAL NOT NULL, gate TEXT NOT NULL,
    label_valid INTEGER NOT NULL,
    CHECK (gate IN ('robot', 'teacher')),
    CHECK (label_valid IN (0, 1)),
    PRIMARY KEY (participant, rollout, attempt, step),
    FOREIGN KEY (participant, rollout, attempt) REFERENCES attempts (participant, rollout, attempt)
) STRICT, WITHOUT ROWID;
CREATE TABLE audit (
    id INTEGER PRIMARY KEY, at_utc TEXT NOT NULL, act TEXT NOT NULL, detail TEXT NOT NULL
) STRICT;
CREATE TRIGGER attempts_end_once BEFORE UPDATE ON attempts
WHEN OLD.status <> 'running' OR NEW.participant <> OLD.participant OR NEW.rollout <> OLD.rollout
    OR NEW.attempt <> OLD.attempt OR NEW.order_index <> OLD.order_index
BEGIN SELECT RAISE(ABORT, 'an attempt ends once and keeps its place'); END;
CREATE TRIGGER steps_join_a_running_attempt BEFORE INSERT ON steps
WHEN NOT EXISTS (
    SELECT 1 FROM attempts WHERE participant = NEW.participant AND rollout = NEW.rollout
    AND attempt = NEW.attempt AND status = 'running'
)
BEGIN SELECT RAISE(ABORT, 'the attempt is not running'); END;
CREATE TRIGGER steps_stay BEFORE UPDATE ON steps
BEGIN SELECT RAISE(ABORT, 'a recorded step is never changed'); END;
CREATE TRIGGER audit_ids_are_new BEFORE INSERT ON audit
WHEN EXISTS (SELECT 1 FROM audit WHERE id = NEW.id)
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;
CREATE TRIGGER audit_stays BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;
CREATE TRIGGER audit_is_kept BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is append only'); END;
INSERT INTO meta VALUES ('schema_version', '1'), ('created_by', 'steerlab 0.1.0');
"""
WORLD = WorldSpec(name="w", ball_xy_m=(9.0, 0.0), start=Pose2D(-9.0, 0.0, 0.0))
ROLLOUT = StoredRollout(name="r0", world=WORLD, control_hz=20.0, seed=3, steps=2)
STEP = LabelledStep(
    participant="P01", rollout="r0", attempt=0, step=0, t_s=0.0, x_m=1 / 3, y_m=0.0,
    heading_rad=0.0, speed_mps=5.0, lateral_speed_mps=0.0, yaw_rate_radps=0.0, acceleration_x_mps2=0.0,
    acceleration_y_mps2=0.0, robot_wheel=0.25, teacher_label=None, oracle_label=0.75,
    executed_wheel=0.25, gate=Driver.ROBOT, label_valid=False,
)  # fmt: skip
STEPS = [STEP, replace(STEP, step=1, teacher_label=0.5, label_valid=True)]
CUT_OFF = replace(STEP, attempt=1)


@pytest.fixture
def old(tmp_path: Path) -> Path:
    path = tmp_path / "study.db"
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.executescript(VERSION_1)
    connection.execute("INSERT INTO participants VALUES ('P01', 'seen')")
    connection.execute("INSERT INTO rollouts VALUES (?, ?, ?, ?, ?)", ROLLOUT.to_row())
    connection.execute("INSERT INTO attempts VALUES ('P01', 'r0', 0, 'running', 0)")
    connection.execute("INSERT INTO attempts VALUES ('P01', 'r0', 1, 'running', 1)")
    from steerlab.sim.records import row_from_step

    for step in (*STEPS, CUT_OFF):
        values = tuple(row_from_step(step).values())
        connection.execute(f"INSERT INTO steps VALUES ({', '.join('?' * len(values))})", values)
    connection.execute("UPDATE attempts SET status = 'finished' WHERE attempt = 0")
    connection.execute("INSERT INTO audit VALUES (1, '2026-01-01T00:00:00Z', 'consent', 'v3')")
    connection.close()
    return path


def attempts(second: AttemptStatus, reason: str | None = None) -> list[Attempt]:
    first = Attempt(
        participant="P01", rollout="r0", attempt=0, status=AttemptStatus.FINISHED, order_index=0
    )
    return [first, replace(first, attempt=1, status=second, order_index=1, end_reason=reason)]


def check_what_was_kept(store: StudyStore) -> None:
    assert store.participants() == {"P01": "seen"}
    assert store.rollouts() == {"r0": ROLLOUT}
    assert [step_from_row(row) for row in store.read_labels().to_pylist()] == STEPS
    assert store.read_labels([*AttemptStatus]).num_rows == 3
    assert store.sessions() == {}
    assert store.timings().equals(TIMING_SCHEMA.empty_table())
    assert store.events(store.attempts()[0]) == []
    assert store.flags(store.attempts()[0]) == []
    assert store.audit()[0].detail == "v3"


def test_an_old_file_is_read_as_it_is(old: Path):
    before = old.read_bytes()
    with StudyStore.open(old, read_only=True) as store:
        check_what_was_kept(store)
        assert store.attempts() == attempts(AttemptStatus.RUNNING)
        with pytest.raises(StoreError, match="readonly"):
            store.add_participant("P02", "seen")
    assert old.read_bytes() == before


def test_an_old_file_is_upgraded_and_goes_on(old: Path):
    with StudyStore.open(old) as store:
        check_what_was_kept(store)
        assert [(e.act, e.detail.split(" by ")[0]) for e in store.audit()[1:]] == [
            ("schema upgraded", f"from 1 to {STORE_VERSION}")
        ]
        assert (
            store.abandon_running("found running after a crash")
            == attempts(AttemptStatus.RUNNING)[1:]
        )
        assert store.attempts() == attempts(AttemptStatus.ABANDONED, "found running after a crash")
        redo = store.begin_attempt("P01", "r0")
        store.append(replace(STEP, attempt=2))
        assert redo.attempt == 2
    with StudyStore.open(old) as store:
        assert len([e for e in store.audit() if e.act == "schema upgraded"]) == 1


def test_an_upgraded_file_is_like_a_new_one(old: Path, tmp_path: Path):
    def schema(path: Path) -> list[tuple[str, str, str]]:
        connection = sqlite3.connect(path)
        rows = connection.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
        connection.close()
        return sorted((kind, name, " ".join((sql or "").split())) for kind, name, sql in rows)

    StudyStore.open(old).close()
    StudyStore.create(tmp_path / "new.db").close()
    upgraded, new = schema(old), schema(tmp_path / "new.db")
    # the steps table of version 1 is written in one line or in several, and means the same
    assert [row[:2] for row in upgraded] == [row[:2] for row in new]
    assert [row for row in upgraded if row[1] != "steps"] == [
        row for row in new if row[1] != "steps"
    ]


def test_a_failed_upgrade_leaves_the_file_as_it_was(old: Path, monkeypatch: pytest.MonkeyPatch):
    broken = (store_schema.VERSIONS[0], store_schema.VERSIONS[1] + "CREATE TABEL oops;")
    with monkeypatch.context() as patch:
        patch.setattr(store_schema, "VERSIONS", broken)
        with pytest.raises(StoreError, match="Cannot open the study"):
            StudyStore.open(old)
    with StudyStore.open(old, read_only=True) as store:
        check_what_was_kept(store)
        assert store._connection.read("SELECT value FROM meta WHERE key = 'schema_version'") == [
            ("1",)
        ]


def test_dangling_rows_are_told_before_an_upgrade(old: Path):
    connection = sqlite3.connect(old)
    connection.execute("DELETE FROM participants")
    connection.commit()
    connection.close()
    with pytest.raises(StoreError, match="refers to 2 rows that are not there"):
        StudyStore.open(old)


def test_two_programs_upgrade_once(old: Path, tmp_path: Path):
    with StudyStore.open(old) as first, StudyStore.open(old) as second:
        assert [e.act for e in second.audit()].count("schema upgraded") == 1
        first.record("consent", "v4")
    copy = tmp_path / "copy.db"
    shutil.copy(old, copy)
    connection = store_schema.connect(copy, read_only=False)
    store_schema._upgrade(connection, copy)  # as the slower of two finds it
    rows = connection.execute("SELECT act FROM audit").fetchall()
    assert rows.count(("schema upgraded",)) == 1
    connection.close()
