"""The audit's hash chain: each entry's hash covers the entry and the hash of the one before.

The chain exposes any edit that does not rebuild all later entries. Against somebody who does that,
keep the newest hash elsewhere: ``study verify`` prints it, and can be told to look for it.
"""

import sqlite3
from dataclasses import dataclass
from hashlib import sha256

from steerlab.study.store.rows import Table


@dataclass(frozen=True, kw_only=True, slots=True)
class AuditEntry:
    """One act, as it was logged; ``at_utc`` is ISO 8601.

    Attributes:
        sha256: of the chain up to here; None only in an entry that another program put in.
    """

    id: int
    at_utc: str
    act: str
    detail: str
    sha256: str | None


AUDIT = Table("audit", AuditEntry)


def entry_sha256(before: str, id_: int, at_utc: str, act: str, detail: str) -> str:
    """The hash of an entry whose predecessor's is ``before``; empty for the first.

    Lengths are hashed too, so that a text cannot be moved from one field into the next.
    """
    digest = sha256()
    for part in (before, str(id_), at_utc, act, detail):
        raw = part.encode("utf-8", "surrogatepass")
        digest.update(f"{len(raw)}:".encode())
        digest.update(raw)
    return digest.hexdigest()


def now(connection: sqlite3.Connection) -> str:
    """The time in UTC as the store keeps it: ISO 8601 to the millisecond."""
    return connection.execute("SELECT strftime('%Y-%m-%dT%H:%M:%fZ', 'now')").fetchone()[0]


def append_audit(connection: sqlite3.Connection, act: str, detail: str) -> None:
    """Add an entry, inside a transaction that holds the write lock."""
    last = connection.execute("SELECT id, sha256 FROM audit ORDER BY id DESC LIMIT 1").fetchone()
    id_, before = (1, "") if last is None else (last[0] + 1, last[1] or "")
    at_utc = now(connection)
    seal = entry_sha256(before, id_, at_utc, act, detail)
    insert = "INSERT INTO audit (id, at_utc, act, detail, sha256) VALUES (?, ?, ?, ?, ?)"
    connection.execute(insert, (id_, at_utc, act, detail, seal))


def read_audit(connection: sqlite3.Connection) -> list[AuditEntry]:
    """All entries, oldest first."""
    return [AUDIT.from_row(row) for row in connection.execute(AUDIT.query("ORDER BY id"))]


def broken_at(entries: list[AuditEntry]) -> AuditEntry | None:
    """The first entry that does not continue the chain; None if it is whole."""
    before = ""
    for entry in entries:
        before = entry_sha256(before, entry.id, entry.at_utc, entry.act, entry.detail)
        if entry.sha256 != before:
            return entry
    return None
