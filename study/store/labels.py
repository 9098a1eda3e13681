"""Reading labelled steps back out of the store, as Arrow tables."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

import sqlite3
from collections.abc import Collection, Iterator

import pyarrow as pa

from steerlab.sim.records import COLUMNS, LABELLED_STEP_SCHEMA
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.records import Attempt, AttemptStatus
from steerlab.study.store.schema import fail

_BATCH_ROWS = 50_000
_LAST_FINISHED = (
    "(SELECT participant, rollout, max(attempt) AS attempt FROM attempts "
    "WHERE status = ? GROUP BY participant, rollout)"
)


def read_labels(
    connection: StoreConnection, statuses: Collection[AttemptStatus] | None
) -> pa.Table:
    """Steps by participant, rollout, attempt and step.

    Args:
        statuses: of the attempts wanted, all of them; None: of each rollout the participant's last
            finished attempt, the one that counts.
    """
    if statuses is None:
        attempts, values = _LAST_FINISHED, [AttemptStatus.FINISHED.value]
    else:
        values = [status.value for status in statuses]
        attempts = f"(SELECT * FROM attempts WHERE status IN ({', '.join('?' * len(values))}))"
    query = (
        f"SELECT {', '.join(f'steps.{name}' for name in COLUMNS)} FROM steps "
        f"JOIN {attempts} USING (participant, rollout, attempt) "
        f"ORDER BY steps.participant, steps.rollout, steps.attempt, steps.step"
    )
    return _table(connection, query, *values)


def read_steps(connection: StoreConnection, attempt: Attempt) -> pa.Table:
    """Steps of one attempt, whatever its status, in order."""
    query = (
        f"SELECT {', '.join(COLUMNS)} FROM steps "
        f"WHERE participant = ? AND rollout = ? AND attempt = ? ORDER BY step"
    )
    return _table(connection, query, *attempt.key)


def _table(connection: StoreConnection, query: str, *values: str | int) -> pa.Table:
    batches = list(_batches(connection, query, *values))
    return pa.Table.from_batches(batches, schema=LABELLED_STEP_SCHEMA)


def _batches(
    connection: StoreConnection, query: str, *values: str | int
) -> Iterator[pa.RecordBatch]:
    try:
        cursor = connection.run(query, *values)
        while rows := cursor.fetchmany(_BATCH_ROWS):
            columns = dict(zip(COLUMNS, map(list, zip(*rows, strict=True)), strict=True))
            columns["label_valid"] = list(map(bool, columns["label_valid"]))
            yield pa.RecordBatch.from_pydict(columns, schema=LABELLED_STEP_SCHEMA)
    except sqlite3.Error as error:
        fail(connection.path, "read the labels", error)
