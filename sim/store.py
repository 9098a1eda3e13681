"""The study store: one SQLite file that keeps every step, attempt and act of a study."""
# pyarrow ships no types, so strict mode would reject each of its names:
# pyright: reportUnknownMemberType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportMissingTypeStubs=false

import sqlite3
from collections.abc import Collection, Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pyarrow as pa

from steerlab.sim.records import (
    COLUMNS,
    LABELLED_STEP_SCHEMA,
    LabelledStep,
    check_name,
    row_from_step,
)
from steerlab.sim.store_records import Attempt, AttemptStatus, AuditEntry, StoredRollout
from steerlab.sim.store_schema import StoreError, create_database, fail, open_database

_BATCH_ROWS = 50_000
_INSERT_STEP = f"INSERT INTO steps VALUES ({', '.join('?' * len(COLUMNS))})"
_THIS_ATTEMPT = "WHERE participant = ? AND rollout = ? AND attempt = ?"


class StudyStore:
    """An open study database; it belongs to the thread that opened it.

    A step is safe from a crash of this program once ``append`` returns, and a finished attempt
    from a power cut as well once ``finish_attempt`` returns. Nothing is ever overwritten.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self._connection = connection

    @classmethod
    def create(cls, path: Path) -> Self:
        """Make a new, empty store.

        Raises:
            StoreError: the file exists already or cannot be made.
        """
        return cls(create_database(path), path)

    @classmethod
    def open(cls, path: Path, *, read_only: bool = False) -> Self:
        """Open an existing store.

        Raises:
            StoreError: the file is missing, foreign, damaged, locked or of a newer schema.
        """
        return cls(open_database(path, read_only=read_only), path)

    def close(self) -> None:
        """Close the file; an attempt that is still running stays marked as running."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def add_participant(self, pseudonym: str, role: str) -> None:
        """Enrol a person under a pseudonym; saying the same twice changes nothing.

        Raises:
            StoreError: the pseudonym is taken with another role.
            InvalidRecord: a text is blank or not printable.
        """
        check_name("pseudonym", pseudonym)
        check_name("role", role)
        with self._transaction(f"enrol {pseudonym!r}"):
            known = self.participants().get(pseudonym, role)
            if known != role:
                raise StoreError(
                    f"{pseudonym!r} is enrolled as {known!r}, not {role!r}; choose another name."
                )
            self._run(
                "INSERT INTO participants VALUES (?, ?) ON CONFLICT DO NOTHING", pseudonym, role
            )

    def add_rollout(self, rollout: StoredRollout) -> None:
        """Register a rollout; saying the same twice changes nothing.

        Raises:
            StoreError: another rollout has that name.
        """
        with self._transaction(f"add rollout {rollout.name!r}"):
            known = self.rollouts().get(rollout.name, rollout)
            if known != rollout:
                raise StoreError(
                    f"Another rollout is stored as {rollout.name!r} (seed {known.seed}, "
                    f"{known.steps} steps); give this one another name."
                )
            insert = "INSERT INTO rollouts VALUES (?, ?, ?, ?, ?) ON CONFLICT DO NOTHING"
            self._run(insert, *rollout.to_row())

    def begin_attempt(self, participant: str, rollout: str) -> Attempt:
        """Open the next attempt of a participant at a rollout: 0, then 1 for a redo, and so on.

        Raises:
            StoreError: the participant or the rollout is not in the store.
        """
        with self._transaction(f"begin an attempt of {participant!r} at {rollout!r}"):
            if participant not in self.participants():
                raise StoreError(f"{participant!r} is not enrolled in {self.path}; add them first.")
            if rollout not in (known := self.rollouts()):
                raise StoreError(f"{rollout!r} is not in {self.path}; it has {[*known]}.")
            tries = [a for a in self.attempts() if a.participant == participant]
            begun = Attempt(
                participant=participant,
                rollout=rollout,
                attempt=sum(a.rollout == rollout for a in tries),
                status=AttemptStatus.RUNNING,
                order_index=len(tries),
            )
            self._run("INSERT INTO attempts VALUES (?, ?, ?, ?, ?)", *begun.to_row())
            self._log("attempt begun", str(begun))
        return begun

    def append(self, step: LabelledStep) -> None:
        """Keep one step of a running attempt.

        Raises:
            StoreError: its attempt is not running, or has that step already.
            InvalidRecord: a number is NaN or infinite, or a text is unusable.
        """
        values = tuple(row_from_step(step).values())
        try:
            self._connection.execute(_INSERT_STEP, values)
        except sqlite3.Error as error:
            fail(self.path, f"keep step {step.step} of {_key(step)}", error)

    def finish_attempt(self, attempt: Attempt) -> None:
        """Mark an attempt as finished; durable against a power cut when this returns.

        Raises:
            StoreError: the attempt lacks steps of its rollout, or is not running.
        """
        with self._transaction(f"finish {attempt}", durable=True):
            self._end(attempt, AttemptStatus.FINISHED)
            count = f"SELECT count(*), max(step) FROM steps {_THIS_ATTEMPT}"
            kept, last = self._run(count, *_key(attempt)).fetchone()
            steps = self.rollouts()[attempt.rollout].steps
            if (kept, last) != (steps, steps - 1):
                raise StoreError(
                    f"{attempt} has {kept} steps, the last is {last}; its rollout has {steps}, "
                    f"counted from 0. Append one for each (invalid ones too), or abandon it."
                )

    def abandon_attempt(self, attempt: Attempt) -> None:
        """Mark an attempt as given up; its steps stay, and ``read_labels`` leaves them out.

        Raises:
            StoreError: the attempt is not running.
        """
        with self._transaction(f"abandon {attempt}", durable=True):
            self._end(attempt, AttemptStatus.ABANDONED)

    def record(self, act: str, detail: str) -> None:
        """Add an act to the audit, which only grows; durable when this returns."""
        with self._transaction(f"log {act!r}", durable=True):
            self._log(check_name("act", act), detail)

    def participants(self) -> dict[str, str]:
        """Role by pseudonym."""
        return dict(self._read("SELECT pseudonym, role FROM participants ORDER BY pseudonym"))

    def rollouts(self) -> dict[str, StoredRollout]:
        """Rollouts by name."""
        rows = self._read("SELECT name, world, control_hz, seed, steps FROM rollouts ORDER BY name")
        return {row[0]: StoredRollout.from_row(row) for row in rows}

    def attempts(self, *statuses: AttemptStatus) -> list[Attempt]:
        """Attempts of the given statuses (none given: all), by participant in their order."""
        columns = "participant, rollout, attempt, status, order_index"
        query = f"SELECT {columns} FROM attempts ORDER BY participant, order_index"
        found = map(Attempt.from_row, self._read(query))
        return [a for a in found if not statuses or a.status in statuses]

    def audit(self) -> list[AuditEntry]:
        """Everything that was logged, in the order it was."""
        rows = self._read("SELECT at_utc, act, detail FROM audit ORDER BY id")
        return [AuditEntry(at_utc=at_utc, act=act, detail=detail) for at_utc, act, detail in rows]

    def read_labels(
        self, statuses: Collection[AttemptStatus] = (AttemptStatus.FINISHED,)
    ) -> pa.Table:
        """Steps of attempts with these statuses, by participant, rollout, attempt and step.

        Returns:
            A table of ``LABELLED_STEP_SCHEMA``; names sort by code point.
        """
        query = (
            f"SELECT {', '.join(f'steps.{name}' for name in COLUMNS)} FROM steps "
            f"JOIN attempts USING (participant, rollout, attempt) "
            f"WHERE status IN ({', '.join('?' * len(statuses))}) "
            f"ORDER BY steps.participant, steps.rollout, steps.attempt, steps.step"
        )
        return pa.Table.from_batches(
            list(self._batches(query, [status.value for status in statuses])),
            schema=LABELLED_STEP_SCHEMA,
        )

    def _batches(self, query: str, values: list[str]) -> Iterator[pa.RecordBatch]:
        try:
            cursor = self._connection.execute(query, values)
            while rows := cursor.fetchmany(_BATCH_ROWS):
                columns = dict(zip(COLUMNS, map(list, zip(*rows, strict=True)), strict=True))
                columns["label_valid"] = list(map(bool, columns["label_valid"]))
                yield pa.RecordBatch.from_pydict(columns, schema=LABELLED_STEP_SCHEMA)
        except sqlite3.Error as error:
            fail(self.path, "read the labels", error)

    def _end(self, attempt: Attempt, status: AttemptStatus) -> None:
        update = f"UPDATE attempts SET status = ? {_THIS_ATTEMPT}"
        if self._run(update, status.value, *_key(attempt)).rowcount != 1:
            raise StoreError(f"There is no {attempt} in {self.path}; begin it first.")
        self._log(f"attempt {status}", str(attempt))

    def _log(self, act: str, detail: str) -> None:
        now = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')"
        self._run(f"INSERT INTO audit (at_utc, act, detail) VALUES ({now}, ?, ?)", act, detail)

    def _run(self, statement: str, *values: Any) -> sqlite3.Cursor:
        return self._connection.execute(statement, values)

    def _read(self, query: str) -> list[Any]:
        try:
            return self._connection.execute(query).fetchall()
        except sqlite3.Error as error:
            fail(self.path, "read", error)

    @contextmanager
    def _transaction(self, act: str, *, durable: bool = False) -> Generator[None]:
        """All of the block or nothing; ``durable`` waits until the disk has it and all before."""
        connection = self._connection
        try:
            if durable:
                connection.execute("PRAGMA synchronous = FULL")
            connection.execute("BEGIN IMMEDIATE")
            yield
            connection.execute("COMMIT")
        except BaseException as error:
            with suppress(sqlite3.Error):  # SQLite may have rolled back, or the file be closed
                connection.execute("ROLLBACK")
            if isinstance(error, sqlite3.Error):
                fail(self.path, act, error)
            raise
        finally:
            if durable:
                with suppress(sqlite3.Error):  # left at FULL, the store is slower, never less safe
                    connection.execute("PRAGMA synchronous = NORMAL")


def _key(of: Attempt | LabelledStep) -> tuple[str, str, int]:
    return of.participant, of.rollout, of.attempt
