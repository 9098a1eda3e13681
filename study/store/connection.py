"""A connection to the study database: transactions, the audit, and errors that say the mend."""

import sqlite3
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from steerlab.study.store.audit import append_audit
from steerlab.study.store.schema import fail


class StoreConnection:
    """What everything that reads or writes the store goes through; stays in one thread."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self.sqlite = connection

    def close(self) -> None:
        """Close the file; calling it again does nothing."""
        self.sqlite.close()

    def run(self, statement: str, *values: Any) -> sqlite3.Cursor:
        """One statement; inside ``transaction``, which turns SQLite's errors into ours."""
        return self.sqlite.execute(statement, values)

    def read(self, query: str, *values: Any) -> list[Any]:
        """All rows.

        Raises:
            StoreError: the file cannot be read.
        """
        try:
            return self.sqlite.execute(query, values).fetchall()
        except sqlite3.Error as error:
            fail(self.path, "read", error)

    def log(self, act: str, detail: str) -> None:
        """Add to the audit; inside ``transaction``."""
        append_audit(self.sqlite, act, detail)

    @contextmanager
    def transaction(self, act: str, *, durable: bool = False) -> Generator[None]:
        """All of the block or nothing; ``durable`` waits until the disk has it and all before.

        Raises:
            StoreError: SQLite could not do it; says that it was ``act``.
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
        finally:
            if durable:
                with suppress(sqlite3.Error):  # left at FULL, the store is slower, never less safe
                    self.run("PRAGMA synchronous = NORMAL")
