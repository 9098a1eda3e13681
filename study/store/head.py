"""The newest audit entry, named in a file beside the database: an older copy of it shows.

SQLite keeps what is newest in a log (``-wal``) until the last program closes the database. The file
alone, copied before that, is a whole database of an earlier state.
"""

import os
import sqlite3
from contextlib import suppress
from pathlib import Path

SUFFIX = "-head"
_LENGTH = 20 + 1 + 64 + 1  # id, blank, SHA-256, line break: one write, over the one before


def keep_head(path: Path, connection: sqlite3.Connection) -> None:
    """Name the newest entry, once the disk has it; ``path`` is the database's.

    A sign and no record: if it cannot be written, what was kept is kept all the same.
    """
    with suppress(OSError, sqlite3.Error):
        id_, sha256 = connection.execute("SELECT max(id), sha256 FROM audit").fetchone()
        if sha256 is None:  # nothing is logged yet
            return
        line = f"{id_:020d} {sha256}\n".encode()
        handle = os.open(_file(path), os.O_WRONLY | os.O_CREAT, 0o600)
        try:
            os.write(handle, line)
        finally:
            os.close(handle)


def missing_head(path: Path, connection: sqlite3.Connection) -> str | None:
    """In words, that the database lacks the entry that was kept last; None if it has it.

    None too where there is no sign, as beside a database that was copied alone.
    """
    try:
        line = _file(path).read_bytes()  # before the database, which is ahead of it
    except OSError:
        return None
    id_, _, sha256 = line.decode("ascii", "replace").strip().partition(" ")
    if len(line) != _LENGTH or not (id_.isascii() and id_.isdecimal()):
        return None  # a power cut left it so
    found = connection.execute("SELECT sha256 FROM audit WHERE id = ?", (int(id_),)).fetchone()
    if found == (sha256,):
        return None
    (newest,) = connection.execute("SELECT coalesce(max(id), 0) FROM audit").fetchone()
    return (
        f"{path} is an older or another copy: entry {int(id_)} of the audit, which {path.name}{SUFFIX} "
        f"beside it names, is not in it (its newest is {newest}). It was copied while a program had "
        f"it open, without {path.name}-wal, or restored alone"
    )


REMEDY = (
    "Close every program and copy the whole folder again; or, to go on from this copy, remove the "
    f"file that ends in {SUFFIX}"
)
"""What to do about a missing head."""


def _file(path: Path) -> Path:
    return Path(f"{path.resolve()}{SUFFIX}")  # where SQLite keeps the log
