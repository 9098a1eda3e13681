"""Taking all rows of another study's database into this one, in one transaction.

Rows that have a number get a new one, above those that are there; every sealed row is sealed anew
in this study's audit. The other's audit is kept beside it as it is, and an entry names its head.
"""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from steerlab.study.store.audit import AUDIT, AuditEntry
from steerlab.study.store.connection import StoreConnection, fail
from steerlab.study.store.errors import StoreError
from steerlab.study.store.seals import ANSWER, ANSWERED, seal, sealed_rows, sealing

MERGED = "merged"
"""The act whose detail is JSON: the study that was taken in, how long its audit was, and its head."""

_RUNNING = {"status": "'running'", "end_reason": "NULL"}  # until the steps are there
_BEFORE_THE_END = ("sessions", "attempts", "steps", "timings", "events", "flags")
_AFTER_THE_END = (
    *("phase_events", "responses", "consents", "links", "notes", "models", "embeddings"),
    *("teaching_rounds", "teaching_targets", "teaching_trials", "departures", "merged_audits"),
)
_TABLE_OF = {
    ANSWER: "responses",
    "attempt": "",  # named by its participant
    "network": "models",
    "w": "embeddings",
    "round": "teaching_rounds",
}
"""Where the number of a sealed row comes from, by its kind."""
_ALLOCATED_IN = "study "
"""Begins what the order of somebody who was taken in was drawn from."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MergedStudy:
    """What this study's audit says of one that was taken in.

    Attributes:
        study: the hash of the first entry of its audit.
        head: of the last.
    """

    study: str
    entries: int
    head: str


def take_in(connection: StoreConnection, other: Path) -> MergedStudy:
    """Add everything of another study, whose participants all have other pseudonyms.

    Args:
        other: its database, without a log (``-wal``), which nobody writes to.

    Raises:
        StoreError: a row has its like here, a kind of seal is unknown, or a file cannot be read or
            written; nothing was added then.
    """
    with _attached(connection, other), connection.transaction(f"take in {other}", durable=True):
        columns = "id, at_utc, act, detail, sha256"
        rows = connection.read(f"SELECT {columns} FROM taken.audit ORDER BY id")
        audit = [AUDIT.from_row(row) for row in rows]
        merged = MergedStudy(
            study=audit[0].sha256 or "", entries=len(audit), head=audit[-1].sha256 or ""
        )
        add = {table: connection.next_id(table) - 1 for table in _numbered(connection)}
        connection.run(
            "INSERT INTO main.rollouts SELECT * FROM taken.rollouts "
            "WHERE name NOT IN (SELECT name FROM main.rollouts)"
        )
        _copy(connection, "participants", add, {})
        _enrol(connection, merged.study)
        for table in _BEFORE_THE_END:
            _copy(connection, table, add, _RUNNING if table == "attempts" else {})
        connection.run(
            "UPDATE main.attempts AS a SET status = t.status, end_reason = t.end_reason "
            "FROM taken.attempts AS t WHERE t.status != 'running' AND a.participant = "
            "t.participant AND a.rollout = t.rollout AND a.attempt = t.attempt"
        )
        for table in _AFTER_THE_END:
            _copy(connection, table, add, {})
        connection.run(
            "INSERT INTO main.merged_audits SELECT ?, id, at_utc, act, detail, sha256 "
            "FROM taken.audit ORDER BY id",
            merged.study,
        )
        detail = {"study": merged.study, "entries": merged.entries, "head": merged.head}
        connection.log(MERGED, json.dumps(detail))
        _seal_anew(connection, audit, add)
    return merged


def read_merged_audits(connection: StoreConnection) -> dict[str, list[AuditEntry]]:
    """The audit of each study that was taken in, by the hash of its first entry."""
    columns = "study, id, at_utc, act, detail, sha256"
    kept: dict[str, list[AuditEntry]] = {}
    for study, *row in connection.read(f"SELECT {columns} FROM merged_audits ORDER BY study, id"):
        kept.setdefault(study, []).append(AUDIT.from_row(tuple(row)))
    return kept


def merged_studies(entries: Sequence[AuditEntry]) -> list[MergedStudy]:
    """The studies that an audit says were taken in.

    Raises:
        StoreError: somebody else wrote into the audit.
    """
    try:
        return [MergedStudy(**json.loads(e.detail)) for e in entries if e.act == MERGED]
    except (ValueError, TypeError, RecursionError) as error:
        raise StoreError(
            "An entry of the audit about a merge is not as steerlab writes it; restore the study "
            "folder from its last copy."
        ) from error


@contextmanager
def _attached(connection: StoreConnection, other: Path) -> Iterator[None]:
    """The other database is ``taken`` in SQL."""
    try:
        connection.run("ATTACH ? AS taken", f"{other.resolve().as_uri()}?mode=ro&immutable=1")
    except sqlite3.Error as error:
        fail(other, "read the study", error)
    try:
        yield
    finally:
        connection.run("DETACH taken")


def _numbered(connection: StoreConnection) -> list[str]:
    """Tables whose rows are numbered, but for the audit."""
    query = (
        "SELECT made.name FROM main.sqlite_master AS made, pragma_table_info(made.name) AS its "
        "WHERE made.type = 'table' AND its.name = 'id' AND its.pk = 1 AND its.type = 'INTEGER'"
    )
    return [name for (name,) in connection.read(query) if name != "audit"]


def _enrol(connection: StoreConnection, study: str) -> None:
    """Enrol the others, in their order; their condition orders were drawn in blocks of their own."""
    names = _columns(connection, "enrolments")
    for row in connection.read(f"SELECT {', '.join(names)} FROM taken.enrolments ORDER BY rowid"):
        values = dict(zip(names, row, strict=True))
        if values["allocation"] and not values["allocation"].startswith(_ALLOCATED_IN):
            values["allocation"] = f"{_ALLOCATED_IN}{study[:12]}: {values['allocation']}"
        connection.insert("enrolments", **values)


def _columns(connection: StoreConnection, table: str) -> list[str]:
    described = connection.read("SELECT name FROM pragma_table_info(?)", table)
    return [name for (name,) in described]


def _copy(
    connection: StoreConnection, table: str, add: Mapping[str, int], instead: Mapping[str, str]
) -> None:
    """Copy a table's rows in their order, with ``instead`` of what some columns hold."""
    names = _columns(connection, table)
    if table in add:
        instead = {**instead, "id": f"id + {add[table]}"}
    columns = ", ".join(instead.get(name, name) for name in names)
    ordered = "ORDER BY id" if table in add else ""
    connection.run(f"INSERT INTO main.{table} SELECT {columns} FROM taken.{table} {ordered}")


def _seal_anew(
    connection: StoreConnection, audit: Sequence[AuditEntry], add: Mapping[str, int]
) -> None:
    for row, digest in sealed_rows(audit).items():
        kind, *key = row
        if kind not in _TABLE_OF:
            raise StoreError(f"This steerlab cannot merge what is sealed as {kind!r}.")
        if table := _TABLE_OF[str(kind)]:
            key = [int(key[0]) + add[table]]
        if kind == ANSWER:
            connection.log(
                ANSWERED, sealing((kind, *key), digest)
            )  # of what it says, not its number
        else:
            seal(connection, str(kind), *key)
