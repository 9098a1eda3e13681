"""Digests of rows in the audit's chain: labels, embeddings, networks and taught rounds, as they were.

Answers have seals of their own (``answers.py``), with a nonce, since there are few possible ones.
"""

import json
from collections.abc import Sequence
from hashlib import sha256

from steerlab.study.store.connection import StoreConnection

SEALED = "sealed"
"""The audit's act; the detail is what is sealed, as JSON, a blank, and the digest."""

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

Key = tuple[str | int, ...]


def seal(connection: StoreConnection, kind: str, *key: str | int) -> None:
    """Add the digest of rows to the audit, in the transaction that completes them.

    Args:
        kind: ``attempt`` (key: participant, rollout, number), ``network``, ``w`` or ``round`` (id).
    """
    what = json.dumps([kind, *key], ensure_ascii=False)
    connection.log(SEALED, f"{what} {_digest(connection, kind, key)}")


def broken_seals(
    connection: StoreConnection, details: Sequence[str]
) -> tuple[list[str], list[tuple[str, Key]], int]:
    """What differs from its seal or has none, what is gone, and how many are as they were.

    Args:
        details: of the audit's ``SEALED`` entries.

    Raises:
        StoreError: the rows cannot be read.
    """
    sealed: dict[tuple[str, Key], str] = {}
    for detail in details:
        what, _, digest = detail.rpartition(" ")
        kind, *key = json.loads(what)
        sealed[kind, tuple(key)] = digest
    present = {
        (kind, tuple(key)) for kind, query in _EVERYTHING.items() for key in connection.read(query)
    }
    changed = [
        f"{kind} {' '.join(map(str, key))}"
        for kind, key in sorted(present, key=str)
        if sealed.get((kind, key)) != _digest(connection, kind, key)
    ]
    gone = [what for what in sealed if what not in present]
    return changed, gone, len(present) - len(changed)


def _digest(connection: StoreConnection, kind: str, key: Key) -> str:
    digest = sha256()
    for query in _QUERIES[kind]:
        for row in connection.read(query, *key):
            plain = [value.hex() if isinstance(value, bytes) else value for value in row]
            digest.update(json.dumps(plain, ensure_ascii=False).encode("utf-8", "surrogatepass"))
        digest.update(b"\n")
    return digest.hexdigest()
