"""The study database's tables, how its file is made, opened and recognised, and what errors say."""

import sqlite3
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

import pyarrow as pa

from steerlab.sim.errors import SteerlabError
from steerlab.sim.records import LABELLED_STEP_SCHEMA, Gate

STORE_VERSION = 1
APPLICATION_ID = 0x53544C42  # "STLB" in the file's header: tells our files from other SQLite files
BUSY_TIMEOUT_S = 5.0


class StoreError(SteerlabError):
    """The study database cannot be opened, read or written, or an act would break its record."""


_MENDS = {
    sqlite3.SQLITE_BUSY: "another program holds it; close that program and try again",
    sqlite3.SQLITE_LOCKED: "another program holds it; close that program and try again",
    sqlite3.SQLITE_READONLY: "make the file and its folder writable, or open it with read_only",
    sqlite3.SQLITE_PERM: "make the file and its folder readable and writable",
    sqlite3.SQLITE_IOERR: "check the disk and its cable",
    sqlite3.SQLITE_CORRUPT: "restore the study folder from its last copy",
    sqlite3.SQLITE_FULL: "free some room on this disk; what was stored before is safe",
    sqlite3.SQLITE_CANTOPEN: "check that the folder exists and is readable and writable",
    sqlite3.SQLITE_NOTADB: "it is not a SQLite file at all; give the study.db of a study folder",
}


def fail(path: Path, act: str, error: sqlite3.Error) -> NoReturn:
    """Raise the ``StoreError`` that says what was tried, why it failed and how to mend it."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the low byte is the primary code
    mend = _MENDS.get(code)
    raise StoreError(f"Cannot {act} in {path}: {error}{f'; {mend}' if mend else ''}.") from error


def create_database(path: Path) -> sqlite3.Connection:
    """Make a new study database, durable when this returns.

    Raises:
        StoreError: the file exists already or cannot be made.
    """
    try:
        path.touch(exist_ok=False)
    except FileExistsError:
        raise StoreError(f"{path} exists already; open it, or choose another folder.") from None
    except OSError as error:
        raise StoreError(
            f"Cannot make {path}: {error.strerror}. Check that its folder exists and is writable."
        ) from error
    connection = None
    try:
        connection = connect(path, read_only=False)
        mode = connection.execute("PRAGMA journal_mode = WAL").fetchone()[0]
        if mode != "wal":
            raise StoreError(
                f"{path.parent} cannot hold a study: its file system has no shared memory (a "
                f"network folder?). Choose a folder on a local disk."
            )
        connection.execute("PRAGMA synchronous = FULL")
        connection.executescript(f"BEGIN; {_TABLES} COMMIT;")
        created_by = f"steerlab {version('steerlab')}"
        connection.executemany(
            "INSERT INTO meta (key, value) VALUES (?, ?)",
            [("schema_version", str(STORE_VERSION)), ("created_by", created_by)],
        )
        connection.execute("PRAGMA synchronous = NORMAL")
    except BaseException as error:
        if connection is not None:
            connection.close()
        path.unlink()
        if isinstance(error, sqlite3.Error):
            fail(path, "make a study", error)
        raise
    return connection


def open_database(path: Path, *, read_only: bool) -> sqlite3.Connection:
    """Open an existing study database of this version or an older one.

    Raises:
        StoreError: the file is missing, foreign, damaged, locked or newer than this steerlab.
    """
    if not path.is_file():
        raise StoreError(f"There is no study database at {path}; check the path or create one.")
    connection = None
    try:
        connection = connect(path, read_only=read_only)
        _recognise(connection, path)
        if not read_only:  # take the write lock once: a read-only file is told now, not in a drive
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("COMMIT")
    except BaseException as error:
        if connection is not None:
            connection.close()
        if isinstance(error, sqlite3.Error):
            fail(path, "open the study", error)
        raise
    return connection


def connect(path: Path, *, read_only: bool) -> sqlite3.Connection:
    """A connection in autocommit, with foreign keys on and one fsync per checkpoint."""
    mode = "ro" if read_only else "rw"
    uri = f"{path.resolve().as_uri()}?mode={mode}"
    connection = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=BUSY_TIMEOUT_S)
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = NORMAL")
    return connection


def _recognise(connection: sqlite3.Connection, path: Path) -> None:
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
        raise StoreError(
            f"{path} is a SQLite file, but not one that steerlab made; give the study.db of a "
            f"study folder."
        )
    meta = dict(connection.execute("SELECT key, value FROM meta"))
    found = meta.get("schema_version", "")
    if not found.isdecimal():
        raise StoreError(f"{path} does not say its schema version; restore it from its last copy.")
    if int(found) > STORE_VERSION:
        raise StoreError(
            f"{path} was written by {meta.get('created_by', 'a newer steerlab')} with schema "
            f"{found}; this steerlab reads up to {STORE_VERSION}. Upgrade steerlab."
        )


def _step_columns() -> str:
    """The columns of ``LABELLED_STEP_SCHEMA`` in SQL: there is one list of them, in records."""
    kinds = {
        pa.string(): "TEXT",
        pa.int32(): "INTEGER",
        pa.float64(): "REAL",
        pa.bool_(): "INTEGER",
    }
    return ", ".join(
        f"{field.name} {kinds[field.type]}{'' if field.nullable else ' NOT NULL'}"
        for field in LABELLED_STEP_SCHEMA
    )


# STRICT: without it SQLite keeps a numpy int as a blob and a text as a number where it can.
_TABLES = f"""
PRAGMA application_id = {APPLICATION_ID};

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
    {_step_columns()},
    CHECK (gate IN ({", ".join(f"'{gate}'" for gate in Gate)})),
    CHECK (label_valid IN (0, 1)),
    PRIMARY KEY (participant, rollout, attempt, step),
    FOREIGN KEY (participant, rollout, attempt) REFERENCES attempts (participant, rollout, attempt)
) STRICT, WITHOUT ROWID;

CREATE TABLE audit (
    id INTEGER PRIMARY KEY, at_utc TEXT NOT NULL, act TEXT NOT NULL, detail TEXT NOT NULL
) STRICT;

-- What was recorded stays as it was, whichever program writes. The insert triggers also stop
-- INSERT OR REPLACE, whose deletions fire no delete trigger.
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
"""
