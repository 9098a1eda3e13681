"""How the study database's file is made, opened, recognised and upgraded, and what errors say."""

import sqlite3
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from steerlab.sim.errors import SteerlabError
from steerlab.study.store.audit import append_audit, seal_audit
from steerlab.study.store.tables import APPLICATION_ID, VERSIONS, VIEWS

STORE_VERSION = len(VERSIONS)
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
        _upgrade(connection, path, new=True)
    except BaseException as error:
        if connection is not None:
            connection.close()
        path.unlink()
        if isinstance(error, sqlite3.Error):
            fail(path, "make a study", error)
        raise
    return connection


def open_database(path: Path, *, read_only: bool) -> sqlite3.Connection:
    """Open an existing study database; one of an older version is upgraded, unless only read.

    Raises:
        StoreError: the file is missing, foreign, damaged, locked or newer than this steerlab.
    """
    if not path.is_file():
        raise StoreError(f"There is no study database at {path}; check the path or create one.")
    connection = None
    try:
        connection = connect(path, read_only=read_only)
        found = _recognise(connection, path)
        if found < STORE_VERSION and read_only:
            connection.executescript(VIEWS[found])
        elif found < STORE_VERSION:
            _upgrade(connection, path)
        elif (
            not read_only
        ):  # take the write lock once: a read-only file is told now, not in a drive
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


def _upgrade(connection: sqlite3.Connection, path: Path, *, new: bool = False) -> None:
    """All versions that are missing or none, durable when this returns."""
    by = f"steerlab {version('steerlab')}"
    connection.execute("PRAGMA foreign_keys = OFF")  # else a table cannot be made anew
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("BEGIN IMMEDIATE")
    try:
        found = 0 if new else _recognise(connection, path)  # another program may have been faster
        for statement in _statements("".join(VERSIONS[found:])):
            connection.execute(statement)
        if dangling := connection.execute("PRAGMA foreign_key_check").fetchall():
            raise StoreError(
                f"{path} refers to {len(dangling)} rows that are not there, so it is left at "
                f"schema {found}; restore the study folder from its last copy."
            )
        if new:
            meta = [("schema_version", str(STORE_VERSION)), ("created_by", by)]
            connection.executemany("INSERT INTO meta (key, value) VALUES (?, ?)", meta)
        elif found < STORE_VERSION:
            set_version = "UPDATE meta SET value = ? WHERE key = 'schema_version'"
            connection.execute(set_version, (str(STORE_VERSION),))
            seal_audit(connection)
            append_audit(connection, "schema upgraded", f"from {found} to {STORE_VERSION} by {by}")
        connection.execute("COMMIT")
    except BaseException:
        with suppress(sqlite3.Error):  # SQLite may have rolled back already
            connection.execute("ROLLBACK")
        raise
    connection.execute("PRAGMA synchronous = NORMAL")
    connection.execute("PRAGMA foreign_keys = ON")


def _statements(script: str) -> Iterator[str]:
    """One by one: ``executescript`` would commit the transaction that it is called in."""
    lines: list[str] = []
    for line in script.splitlines():
        lines.append(line)
        if sqlite3.complete_statement("\n".join(lines)):
            yield "\n".join(lines)
            lines = []
    if "".join(lines).strip():
        yield "\n".join(lines)


def _recognise(connection: sqlite3.Connection, path: Path) -> int:
    """The schema version of a file that we can read."""
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
        raise StoreError(
            f"{path} is a SQLite file, but not one that steerlab made; give the study.db of a "
            f"study folder."
        )
    meta = dict(connection.execute("SELECT key, value FROM meta"))
    found = meta.get("schema_version", "")
    if not found.isdecimal() or int(found) < 1:
        raise StoreError(f"{path} does not say its schema version; restore it from its last copy.")
    if int(found) > STORE_VERSION:
        raise StoreError(
            f"{path} was written by {meta.get('created_by', 'a newer steerlab')} with schema "
            f"{found}; this steerlab reads up to {STORE_VERSION}. Upgrade steerlab."
        )
    return int(found)
