"""A consistent copy of a study's database, also while other programs write into it."""

import sqlite3
from contextlib import closing
from pathlib import Path

from steerlab.study.store.connection import StoreConnection, fail


def copy_database(source: StoreConnection, target: Path) -> None:
    """Write all that was committed by now to a new file, by SQLite's own backup.

    Nobody who writes meanwhile waits for it. The copy is complete without a write-ahead log.

    Raises:
        StoreError: the source cannot be read, or the disk does not take the copy.
    """
    target.touch(mode=0o600, exist_ok=False)
    try:
        with closing(sqlite3.connect(target)) as copy:
            source.sqlite.backup(copy)  # all pages in one step: a single snapshot
    except sqlite3.Error as error:
        fail(target, f"copy {source.path}", error)
