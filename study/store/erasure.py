"""Erasing a participant: the one sanctioned way to delete what was recorded."""

import sqlite3

from steerlab.study.store.connection import StoreConnection, fail
from steerlab.study.store.errors import StoreError
from steerlab.study.store.people import Departure, write_departure
from steerlab.study.store.schema import ERASED_IN_ORDER


def erase_rows(connection: StoreConnection, participant: str) -> None:
    """Delete all rows of a participant but the tombstone and their link's hash; all or none.

    The pages they lay on are overwritten with zeros. ``scrub`` must follow: copies of pages are
    still in the write-ahead log.

    Raises:
        StoreError: the database is busy or cannot be written.
    """
    connection.run("PRAGMA secure_delete = ON")
    with connection.transaction(f"erase {participant!r}", durable=True):
        connection.run("INSERT INTO erasing VALUES (?)", participant)
        for table in ERASED_IN_ORDER:
            connection.run(f"DELETE FROM {table} WHERE participant = ?", participant)
        newest = "SELECT max(id) FROM links WHERE participant = ?"
        connection.run(
            f"DELETE FROM links WHERE participant = ? AND id < ({newest})", participant, participant
        )
        connection.run("DELETE FROM erasing")
        write_departure(connection, participant, Departure.ERASING)


def scrub(connection: StoreConnection) -> None:
    """Rewrite the file without what was deleted, and empty the write-ahead log.

    Raises:
        StoreError: another program reads the database, so that traces remain.
    """
    try:
        connection.run("VACUUM")
        busy, _, _ = connection.run("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    except sqlite3.Error as error:
        fail(connection.path, "remove what was erased", error)
    if busy:
        raise StoreError(
            f"Another program reads {connection.path}, so traces of what was erased remain in its "
            f"write-ahead log; close it and withdraw the participant again."
        )
