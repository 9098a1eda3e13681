"""The study database's file: made, opened, recognised, and read and written in transactions."""

import logging
import sqlite3
from collections.abc import Generator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn, Self

from steerlab.sim.files.refusal import refusal
from steerlab.study.store.audit import append_audit, now
from steerlab.study.store.errors import StoreError
from steerlab.study.store.head import REMEDY, keep_head, missing_head
from steerlab.study.store.schema import APPLICATION_ID, SCHEMA, STORE_VERSION

_log = logging.getLogger(__name__)

BUSY_TIMEOUT_S = 5.0

_REMEDIES = {
    sqlite3.SQLITE_BUSY: "another program holds it; close that program and try again",
    sqlite3.SQLITE_LOCKED: "another program holds it; close that program and try again",
    sqlite3.SQLITE_READONLY: "make the file and its folder writable, or open it with read_only",
    sqlite3.SQLITE_PERM: "make the file and its folder readable and writable",
    sqlite3.SQLITE_IOERR: "see that this disk has room and no quota or limit of the size of files "
    "(ulimit -f) is met, then check the disk and its cable; what was stored before is safe",
    sqlite3.SQLITE_CORRUPT: "restore the study folder from its last copy",
    sqlite3.SQLITE_FULL: "free some room on this disk; what was stored before is safe",
    sqlite3.SQLITE_CANTOPEN: "check that the folder exists and is readable and writable, and that "
    "this program may open more files (ulimit -n)",
    sqlite3.SQLITE_NOTADB: "it is not a SQLite file at all; give the study.db of a study folder",
}


def fail(path: Path, act: str, error: sqlite3.Error) -> NoReturn:
    """Raise the ``StoreError`` that says what was tried, why it failed and what to do."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the low byte is the primary code
    remedy = _REMEDIES.get(code)
    raise StoreError(
        f"Cannot {act} in {path}: {error}{f'; {remedy}' if remedy else ''}."
    ) from error


class StoreConnection:
    """An open study database: all reads and writes go through it, in one thread."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self.sqlite = connection

    @classmethod
    def create(cls, path: Path) -> Self:
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
                f"Cannot make {path}: "
                f"{refusal(error, 'check that its folder exists and is writable')}."
            ) from error
        try:
            with _closed_on_error(path, "make a study", read_only=False) as connection:
                _fill(connection, path)
        except BaseException:
            path.unlink()
            raise
        return cls(connection, path)

    @classmethod
    def open(cls, path: Path, *, read_only: bool) -> Self:
        """Open an existing study database.

        Args:
            read_only: change nothing; also from where nothing can be written.

        Raises:
            StoreError: the file is missing, foreign, damaged, locked, of another version, or an
                older copy; the last is a warning if nothing is to be changed.
        """
        if not path.is_file():
            raise StoreError(f"There is no study database at {path}; check the path or create one.")
        with _closed_on_error(path, "open the study", read_only=read_only) as connection:
            _check_ours(connection, path)
            older = missing_head(path, connection)
            if older and not read_only:
                raise StoreError(f"{older}. {REMEDY}.")
            if not read_only:  # take the lock once: a read-only file is told now, not in a drive
                connection.execute("BEGIN IMMEDIATE")
                connection.execute("COMMIT")
        if older:
            _log.warning("%s. %s.", older, REMEDY)
        return cls(connection, path)

    def close(self) -> None:
        """Close the file; calling it again does nothing."""
        self.sqlite.close()

    def run(self, statement: str, *values: Any) -> sqlite3.Cursor:
        """Run one statement, inside ``transaction``, which turns SQLite's errors into ours."""
        return self.sqlite.execute(statement, values)

    def insert(self, table: str, **values: Any) -> None:
        """Add a row, by column; inside ``transaction``."""
        places = ", ".join("?" * len(values))
        self.run(f"INSERT INTO {table} ({', '.join(values)}) VALUES ({places})", *values.values())

    def read(self, query: str, *values: Any) -> list[Any]:
        """All rows of a query.

        Raises:
            StoreError: the file cannot be read.
        """
        try:
            return self.sqlite.execute(query, values).fetchall()
        except sqlite3.Error as error:
            fail(self.path, "read", error)

    def now(self) -> str:
        """The time in UTC as the store keeps it: ISO 8601 to the millisecond."""
        return now(self.sqlite)

    def next_id(self, table: str) -> int:
        """The id of the row that is inserted next; inside ``transaction``."""
        return self.run(f"SELECT coalesce(max(id), 0) + 1 FROM {table}").fetchone()[0]

    def log(self, act: str, detail: str) -> None:
        """Add to the audit; inside ``transaction``."""
        append_audit(self.sqlite, act, detail)

    @contextmanager
    def snapshot(self) -> Generator[None]:
        """Read in this block what was kept when it began, whatever others keep meanwhile.

        In a transaction, or a snapshot, it adds nothing.

        Raises:
            StoreError: the file cannot be read.
        """
        if self.sqlite.in_transaction:
            yield
            return
        self.read("BEGIN")
        try:
            yield
        finally:
            with suppress(sqlite3.Error):  # SQLite has rolled back, or the file is closed
                self.run("ROLLBACK")

    @contextmanager
    def transaction(self, act: str, *, durable: bool = False) -> Generator[None]:
        """Do all of the block or nothing; ``durable`` waits until the disk has it and all before.

        Raises:
            StoreError: SQLite could not do it; the message names ``act``.
        """
        try:
            if durable:
                self.run("PRAGMA synchronous = FULL")
            self.run("BEGIN IMMEDIATE")
            yield
            self.run("COMMIT")
        except BaseException as error:
            with suppress(sqlite3.Error):  # SQLite may have rolled back, or the file be closed
                self.run("ROLLBACK")
            if isinstance(error, sqlite3.Error):
                fail(self.path, act, error)
            raise
        else:
            if durable:
                keep_head(self.path, self.sqlite)
        finally:
            if durable:
                with suppress(sqlite3.Error):  # left at FULL, the store is slower, never less safe
                    self.run("PRAGMA synchronous = NORMAL")


def connect(path: Path, *, read_only: bool) -> sqlite3.Connection:
    """A connection in autocommit, with foreign keys on and one fsync per checkpoint.

    To read from a read-only medium SQLite must be told that the file cannot change, since it can
    keep no locks beside it. That is true of a file without a log (``-wal``) alone.

    Raises:
        StoreError: there is a log, and nothing can be written beside it.
        sqlite3.Error: the file cannot be opened.
    """
    if not read_only:
        return _connect(path, "mode=rw")
    try:
        return _connect(path, "mode=ro")
    except sqlite3.Error as error:
        if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY):
            raise
        log = Path(f"{path.resolve()}-wal")
        if log.exists() and log.stat().st_size:
            raise StoreError(
                f"{path} was copied while a program had it open, or that program died: what was "
                f"kept last is in {log.name}, which can be read only where files can be written. "
                f"Copy the whole folder to such a place."
            ) from error
        return _connect(path, "mode=ro&immutable=1")


def _connect(path: Path, options: str) -> sqlite3.Connection:
    uri = f"{path.resolve().as_uri()}?{options}"
    connection = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=BUSY_TIMEOUT_S)
    try:
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = NORMAL")  # reads the file
    except BaseException:  # no database, or a locked one
        connection.close()
        raise
    return connection


@contextmanager
def _closed_on_error(path: Path, act: str, *, read_only: bool) -> Generator[sqlite3.Connection]:
    connection = None
    try:
        connection = connect(path, read_only=read_only)
        yield connection
    except BaseException as error:
        if connection is not None:
            connection.close()
        if isinstance(error, sqlite3.Error):
            fail(path, act, error)
        raise


def _fill(connection: sqlite3.Connection, path: Path) -> None:
    if connection.execute("PRAGMA journal_mode = WAL").fetchone()[0] != "wal":
        raise StoreError(
            f"{path.parent} cannot hold a study: its file system has no shared memory (a "
            f"network folder?). Choose a folder on a local disk."
        )
    connection.execute("PRAGMA synchronous = FULL")
    connection.executescript(f"BEGIN IMMEDIATE;\n{SCHEMA}")
    meta = [("schema_version", str(STORE_VERSION)), ("created_by", _this_steerlab())]
    connection.executemany("INSERT INTO meta (key, value) VALUES (?, ?)", meta)
    connection.execute("COMMIT")
    connection.execute("PRAGMA synchronous = NORMAL")


def _check_ours(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse what this steerlab did not make and cannot read."""
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
        tables = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables == 0 and _is_logged(path):
            raise StoreError(
                f"{path} was copied without {path.name}-wal, in which a program had just kept all "
                f"there is. Close that program and copy the whole folder again, with every file."
            )
        raise StoreError(
            f"{path} is a SQLite file, but not one that steerlab made; give the study.db of a "
            f"study folder."
        )
    meta = dict(connection.execute("SELECT key, value FROM meta"))
    schema = f"schema version {meta.get('schema_version', 'none')}"
    if schema == f"schema version {STORE_VERSION}":
        # Unreleased schemas share the number; they differ in what they lack.
        missing = sorted(_expected() - _columns(connection))
        if not missing:
            return
        schema += f" without {missing[0]}"
    raise StoreError(
        f"{path} was made by another version of steerlab ({meta.get('created_by', 'unknown')}, "
        f"{schema}), and this one ({_this_steerlab()}, schema version {STORE_VERSION}) cannot read "
        f"it: open it with the steerlab that made it, since formats that were never released are "
        f"not converted."
    )


def _is_logged(path: Path) -> bool:
    """Whether a file's header says that it has a log (``-wal``)."""
    with path.open("rb") as file:
        return file.read(20)[18:] == b"\2\2"  # versions of the formats: 2 is WAL


def _this_steerlab() -> str:
    return f"steerlab {version('steerlab')}"


@cache
def _expected() -> set[str]:
    connection = sqlite3.connect(":memory:")
    try:
        connection.executescript(SCHEMA)
        return _columns(connection)
    finally:
        connection.close()


def _columns(connection: sqlite3.Connection) -> set[str]:
    """All columns there are, as ``table.column``."""
    query = (
        "SELECT made.name || '.' || its.name FROM sqlite_master AS made, "
        "pragma_table_info(made.name) AS its WHERE made.type = 'table'"
    )
    return {name for (name,) in connection.execute(query)}
