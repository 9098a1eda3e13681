"""The audit's hash chain: each entry seals itself and, through the one before, all before it.

The chain shows edits that do not rebuild all of it from there on. Against somebody who does, keep
the newest hash elsewhere: ``study verify`` prints it, and takes it back to look for it.
"""

import sqlite3
from dataclasses import dataclass
from hashlib import sha256

_NOW = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')"


@dataclass(frozen=True, kw_only=True, slots=True)
class SealedEntry:
    """An entry of the audit; ``sha256`` is None in a file of an older schema that is only read."""

    id: int
    at_utc: str
    act: str
    detail: str
    sha256: str | None


def entry_sha256(before: str, id_: int, at_utc: str, act: str, detail: str) -> str:
    """The hash of an entry whose predecessor's is ``before``; empty for the first.

    Lengths go in, so that no text can pass for the end of one field and the start of the next.
    """
    digest = sha256()
    for part in (before, str(id_), at_utc, act, detail):
        raw = part.encode("utf-8", "surrogatepass")
        digest.update(f"{len(raw)}:".encode())
        digest.update(raw)
    return digest.hexdigest()


def append_audit(connection: sqlite3.Connection, act: str, detail: str) -> None:
    """Add an entry, inside a transaction that holds the write lock."""
    last = connection.execute("SELECT id, sha256 FROM audit ORDER BY id DESC LIMIT 1").fetchone()
    id_, before = (1, "") if last is None else (last[0] + 1, last[1])
    at_utc = connection.execute(f"SELECT {_NOW}").fetchone()[0]
    seal = entry_sha256(before or "", id_, at_utc, act, detail)
    insert = "INSERT INTO audit (id, at_utc, act, detail, sha256) VALUES (?, ?, ?, ?, ?)"
    connection.execute(insert, (id_, at_utc, act, detail, seal))


def seal_audit(connection: sqlite3.Connection) -> None:
    """Seal the entries of an older schema, in order; inside the transaction that upgrades it."""
    before = ""
    rows = connection.execute("SELECT id, at_utc, act, detail, sha256 FROM audit ORDER BY id")
    for id_, at_utc, act, detail, seal in rows.fetchall():
        if seal is None:
            seal = entry_sha256(before, id_, at_utc, act, detail)
            connection.execute("UPDATE audit SET sha256 = ? WHERE id = ?", (seal, id_))
        before = seal


def read_sealed(connection: sqlite3.Connection) -> list[SealedEntry]:
    """All entries, oldest first."""
    rows = connection.execute("SELECT id, at_utc, act, detail, sha256 FROM audit ORDER BY id")
    return [
        SealedEntry(id=id_, at_utc=at_utc, act=act, detail=detail, sha256=seal)
        for id_, at_utc, act, detail, seal in rows
    ]


def broken_at(entries: list[SealedEntry]) -> SealedEntry | None:
    """The first entry that does not continue the chain; None if it is whole."""
    before = ""
    for entry in entries:
        before = entry_sha256(before, entry.id, entry.at_utc, entry.act, entry.detail)
        if entry.sha256 != before:
            return entry
    return None
