"""Digests of rows in the audit's chain: labels, embeddings, networks and taught rounds, as they were.

Answers have digests of their own (``answers.py``), with a nonce, since there are few possible ones.
An erasure logs which sealed rows it takes, by kind and id: what else is gone, nobody erased.
"""

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256

from steerlab.study.store.audit import AuditEntry
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.errors import StoreError

SEALED = "sealed"
ANSWERED = "answer kept"
"""Acts of the audit whose detail is a row's kind and key, as a JSON list, a blank, and its digest."""
ROWS_ERASED = "rows erased"
"""The act whose detail is a JSON list of such kinds with keys."""
ANSWER = "response"
"""The kind of an answer."""

_OF_ATTEMPT = "WHERE participant = ? AND rollout = ? AND attempt = ?"
_ROUND = "WHERE id = ?"
_QUERIES: dict[str, tuple[str, ...]] = {
    "attempt": (
        f"SELECT participant, rollout, attempt, order_index, session, status, end_reason "
        f"FROM attempts {_OF_ATTEMPT}",
        f"SELECT * FROM steps {_OF_ATTEMPT} ORDER BY step",
        f"SELECT * FROM timings {_OF_ATTEMPT} ORDER BY step",
        f"SELECT * FROM events {_OF_ATTEMPT} ORDER BY id",
        f"SELECT * FROM flags {_OF_ATTEMPT} ORDER BY name",
    ),
    "network": ("SELECT id, at_utc, file, sha256, people, inputs FROM models WHERE id = ?",),
    "w": ("SELECT * FROM embeddings WHERE id = ?",),
    "round": (
        f"SELECT * FROM teaching_rounds {_ROUND}",
        "SELECT t.* FROM teaching_targets AS t JOIN teaching_rounds AS r "
        f"USING (participant, rollout, attempt) {_ROUND.replace('id', 'r.id')} ORDER BY t.step",
    ),
}
_EVERYTHING = {
    "attempt": "SELECT participant, rollout, attempt FROM attempts WHERE status != 'running'",
    "network": "SELECT id FROM models",
    "w": "SELECT id FROM embeddings",
    "round": "SELECT id FROM teaching_rounds",
}

_SEALED_OF = {
    ANSWER: "SELECT id FROM responses WHERE participant = ?",
    "attempt": f"{_EVERYTHING['attempt']} AND participant = ?",
    "w": "SELECT id FROM embeddings WHERE participant = ?",
    "round": "SELECT id FROM teaching_rounds WHERE participant = ?",
}
"""What an erasure takes; networks stay."""

Row = tuple[str | int, ...]
"""A kind and a key, such as ``("w", 3)``."""


def seal(connection: StoreConnection, kind: str, *key: str | int) -> None:
    """Add the digest of rows to the audit, in the transaction that completes them.

    Args:
        kind: ``attempt`` (key: participant, rollout, number), ``network``, ``w`` or ``round`` (id).
    """
    connection.log(SEALED, sealing((kind, *key), _digest(connection, (kind, *key))))


def sealing(row: Row, digest: str) -> str:
    """The text that the audit keeps of a sealed row."""
    return f"{json.dumps(row, ensure_ascii=False)} {digest}"


def log_erasure(connection: StoreConnection, participant: str) -> None:
    """Log which sealed rows go with a person, before they go and in the same transaction."""
    rows = [
        (kind, *key)
        for kind, query in _SEALED_OF.items()
        for key in connection.read(query, participant)
    ]
    if rows:
        connection.log(ROWS_ERASED, json.dumps(rows, ensure_ascii=False))


def sealed_rows(entries: Sequence[AuditEntry]) -> dict[Row, str]:
    """The digest of every row that the audit sealed and no erasure took.

    Raises:
        StoreError: somebody else wrote into the audit.
    """
    sealed: dict[Row, str] = {}
    for entry in entries:
        try:
            if entry.act in (SEALED, ANSWERED):
                row, _, digest = entry.detail.rpartition(" ")
                sealed[_row(json.loads(row))] = digest
            elif entry.act == ROWS_ERASED:
                for row in json.loads(entry.detail):
                    sealed.pop(_row(row), None)
        except (ValueError, TypeError, RecursionError) as error:
            raise StoreError(
                f"Entry {entry.id} of the audit ({entry.act}) says {entry.detail[:60]!r}, which is "
                "not as steerlab writes it; restore the study folder from its last copy."
            ) from error
    return sealed


def broken_seals(
    connection: StoreConnection, sealed: Mapping[Row, str]
) -> tuple[list[str], list[str], int]:
    """What differs from its seal or has none, what is gone, and how many are as they were.

    Args:
        sealed: from ``sealed_rows``; answers are left out.

    Raises:
        StoreError: the rows cannot be read.
    """
    present: set[Row] = {
        (kind, *key) for kind, query in _EVERYTHING.items() for key in connection.read(query)
    }
    changed = [
        _name(row)
        for row in sorted(present, key=str)
        if sealed.get(row) != _digest(connection, row)
    ]
    gone = [_name(row) for row in sealed if row[0] != ANSWER and row not in present]
    return changed, gone, len(present) - len(changed)


def _row(values: Sequence[str | int]) -> Row:
    kind, *key = values
    return (kind, *key)


def _name(row: Row) -> str:
    return " ".join(map(str, row))


def _digest(connection: StoreConnection, row: Row) -> str:
    kind, *key = row
    digest = sha256()
    for query in _QUERIES[str(kind)]:
        for values in connection.read(query, *key):
            plain = [value.hex() if isinstance(value, bytes) else value for value in values]
            digest.update(json.dumps(plain, ensure_ascii=False).encode("utf-8", "surrogatepass"))
        digest.update(b"\n")
    return digest.hexdigest()
