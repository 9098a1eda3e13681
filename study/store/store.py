"""The study store: one SQLite file that keeps every step, attempt and act of a study."""
# pyarrow ships no types, so strict mode would reject each of its names:
# pyright: reportUnknownMemberType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportMissingTypeStubs=false

import sqlite3
from collections.abc import Collection, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Self

import pyarrow as pa

from steerlab.sim.records import (
    COLUMNS,
    LABELLED_STEP_SCHEMA,
    LabelledStep,
    check_name,
    row_from_step,
    step_from_row,
)
from steerlab.study.store.audit import AUDIT, AuditEntry
from steerlab.study.store.connection import StoreConnection, fail
from steerlab.study.store.errors import StoreError
from steerlab.study.store.head import SUFFIX
from steerlab.study.store.records import (
    ATTEMPTS,
    EVENTS,
    FLAGS,
    ROLLOUTS,
    SESSIONS,
    TIMING_SCHEMA,
    TIMINGS,
    Attempt,
    AttemptData,
    AttemptStatus,
    Event,
    Flag,
    SessionRecord,
    StoredRollout,
)
from steerlab.study.store.seals import seal
from steerlab.teleop.timing import StepTiming

STUDY_FILE = "study.db"
"""The store's name in a study's folder."""
DATABASE_FILES = (STUDY_FILE, f"{STUDY_FILE}-wal", f"{STUDY_FILE}-shm", f"{STUDY_FILE}{SUFFIX}")
"""The store with what lies beside it."""

_INSERT_STEP = f"INSERT INTO steps VALUES ({', '.join('?' * len(COLUMNS))})"
_THIS_ATTEMPT = "WHERE participant = ? AND rollout = ? AND attempt = ?"
_LAST_FINISHED = (
    "(SELECT participant, rollout, max(attempt) AS attempt FROM attempts "
    "WHERE status = ? GROUP BY participant, rollout)"
)
_BATCH_ROWS = 50_000


class StudyStore:
    """An open study database; it belongs to the thread that opened it.

    A step is safe from a crash of this program once ``append`` returns, and a finished attempt
    from a power cut as well once ``finish_attempt`` returns. Nothing is ever overwritten.

    Attributes:
        connection: for the tables that have no methods here; see ``people``, ``answers``,
            ``frozen`` and ``teaching``.
    """

    def __init__(self, connection: StoreConnection) -> None:
        self.connection = connection

    @property
    def path(self) -> Path:
        """The file."""
        return self.connection.path

    @classmethod
    def create(cls, path: Path) -> Self:
        """Make a new, empty store.

        Raises:
            StoreError: the file exists already or cannot be made.
        """
        return cls(StoreConnection.create(path))

    @classmethod
    def open(cls, path: Path, *, read_only: bool = False) -> Self:
        """Open an existing store.

        Raises:
            StoreError: the file is missing, foreign, damaged, locked or of another version.
        """
        return cls(StoreConnection.open(path, read_only=read_only))

    def close(self) -> None:
        """Close the file; an attempt that is still running stays marked as running."""
        self.connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add_participant(self, pseudonym: str, role: str) -> None:
        """Enrol a person under a pseudonym; the same call twice changes nothing.

        Raises:
            StoreError: the pseudonym is taken with another role.
            InvalidRecord: a text is blank or not printable.
        """
        check_name("pseudonym", pseudonym)
        check_name("role", role)
        with self.connection.transaction(f"enrol {pseudonym!r}"):
            known = self.participants().get(pseudonym)
            if known is None:
                self.connection.insert("participants", pseudonym=pseudonym, role=role)
            elif known != role:
                raise StoreError(
                    f"{pseudonym!r} is enrolled as {known!r}, not {role!r}; choose another name."
                )

    def add_rollout(self, rollout: StoredRollout) -> None:
        """Register a rollout; the same call twice changes nothing.

        Raises:
            StoreError: another rollout has that name.
        """
        with self.connection.transaction(f"add rollout {rollout.name!r}"):
            known = self.rollouts().get(rollout.name)
            if known is None:
                ROLLOUTS.insert(self.connection, rollout)
            elif known != rollout:
                raise StoreError(
                    f"Another rollout is stored as {rollout.name!r} (seed {known.seed}, "
                    f"{known.steps} steps); give this one another name."
                )

    def add_session(self, session: SessionRecord) -> None:
        """Keep when a session began and with what device; durable when this returns.

        Raises:
            StoreError: its id is taken, or its participant is not enrolled.
        """
        with self.connection.transaction(f"keep session {session.id!r}", durable=True):
            SESSIONS.insert(self.connection, session)
            detail = f"session {session.id!r} of {session.participant!r}"
            self.connection.log("session begun", detail)

    def begin_attempt(
        self, participant: str, rollout: str, *, session: str | None = None
    ) -> Attempt:
        """Open the next attempt of a participant at a rollout: 0, then 1 for a redo, and so on.

        Raises:
            StoreError: the participant, the rollout or the session is not in the store.
        """
        with self.connection.transaction(f"begin an attempt of {participant!r} at {rollout!r}"):
            if participant not in self.participants():
                raise StoreError(f"{participant!r} is not enrolled in {self.path}; add them first.")
            if rollout not in (known := self.rollouts()):
                raise StoreError(f"{rollout!r} is not in {self.path}; it has {[*known]}.")
            if session is not None:
                self._check_session(session, participant)
            tries = [a for a in self.attempts() if a.participant == participant]
            begun = Attempt(
                participant=participant,
                rollout=rollout,
                attempt=sum(a.rollout == rollout for a in tries),
                status=AttemptStatus.RUNNING,
                order_index=len(tries),
                session=session,
            )
            ATTEMPTS.insert(self.connection, begun)
            self.connection.log("attempt begun", str(begun))
        return begun

    def append(self, step: LabelledStep, times: StepTiming | None = None) -> None:
        """Keep one step of a running attempt, and when it happened.

        Raises:
            StoreError: its attempt is not running, or has that step already.
            InvalidRecord: a number is NaN or infinite, or a text is unusable.
        """
        row = row_from_step(step)
        with self.connection.transaction(f"keep step {step.step} of {step.rollout!r}"):
            self.connection.run(_INSERT_STEP, *row.values())
            if times is not None:
                key = {name: row[name] for name in ("participant", "rollout", "attempt", "step")}
                TIMINGS.insert(self.connection, times, **key)

    def add_event(self, attempt: Attempt, event: Event) -> None:
        """Keep something that happened in a running attempt.

        Raises:
            StoreError: the attempt is not running.
        """
        with self.connection.transaction(f"keep {event.what!r} of {attempt}"):
            EVENTS.insert(self.connection, event, **_key(attempt))

    def finish_attempt(self, attempt: Attempt, flags: Sequence[Flag] = ()) -> None:
        """Mark an attempt as finished; durable against a power cut when this returns.

        Args:
            flags: the limits that it broke.

        Raises:
            StoreError: the attempt lacks steps of its rollout, or is not running.
        """
        with self.connection.transaction(f"finish {attempt}", durable=True):
            for flag in flags:
                FLAGS.insert(self.connection, flag, **_key(attempt))
            self._end(attempt, AttemptStatus.FINISHED)
            count = f"SELECT count(*), max(step) FROM steps {_THIS_ATTEMPT}"
            kept, last = self.connection.run(count, *attempt.key).fetchone()
            steps = self.rollouts()[attempt.rollout].steps or kept
            if kept == 0 or (kept, last) != (steps, steps - 1):
                raise StoreError(
                    f"{attempt} has {kept} steps, the last is {last}; its rollout has {steps}, "
                    f"counted from 0. Append one for each (invalid ones too), or abandon it."
                )

    def abandon_attempt(self, attempt: Attempt, reason: str) -> None:
        """Mark an attempt as given up; its steps stay, and ``read_labels`` leaves them out.

        Raises:
            StoreError: the attempt is not running.
            InvalidRecord: the reason is blank or not printable.
        """
        check_name("reason", reason)
        with self.connection.transaction(f"abandon {attempt}", durable=True):
            self._end(attempt, AttemptStatus.ABANDONED, reason)

    def abandon_running(self, reason: str) -> list[Attempt]:
        """Abandon the attempts that a crash left running, so that they are redone.

        Returns:
            those attempts.
        """
        running = self.attempts(AttemptStatus.RUNNING)
        for attempt in running:
            self.abandon_attempt(attempt, reason)
        return running

    def record(self, act: str, detail: str) -> None:
        """Add an act to the audit, which only grows; durable when this returns."""
        with self.connection.transaction(f"log {act!r}", durable=True):
            self.connection.log(check_name("act", act), detail)

    def participants(self) -> dict[str, str]:
        """Role by pseudonym."""
        query = "SELECT pseudonym, role FROM participants ORDER BY pseudonym"
        return dict(self.connection.read(query))

    def rollouts(self) -> dict[str, StoredRollout]:
        """Rollouts by name."""
        rollouts = ROLLOUTS.select(self.connection, "ORDER BY name")
        return {rollout.name: rollout for rollout in rollouts}

    def attempts(self, *statuses: AttemptStatus) -> list[Attempt]:
        """Attempts of the given statuses (none given: all), by participant in their order."""
        attempts = ATTEMPTS.select(self.connection, "ORDER BY participant, order_index")
        return [a for a in attempts if not statuses or a.status in statuses]

    def sessions(self) -> dict[str, SessionRecord]:
        """Sessions by id, in the order in which they began."""
        sessions = SESSIONS.select(self.connection, "ORDER BY started_utc, id")
        return {session.id: session for session in sessions}

    def events(self, attempt: Attempt) -> list[Event]:
        """What happened in an attempt, in the order in which it was kept."""
        return EVENTS.select(self.connection, f"{_THIS_ATTEMPT} ORDER BY id", *attempt.key)

    def flags(self, attempt: Attempt) -> list[Flag]:
        """The limits of timing that an attempt broke, by name."""
        return FLAGS.select(self.connection, f"{_THIS_ATTEMPT} ORDER BY name", *attempt.key)

    def audit(self) -> list[AuditEntry]:
        """Everything that was logged, in the order it was."""
        return AUDIT.select(self.connection, "ORDER BY id")

    def timings(self, attempt: Attempt | None = None) -> pa.Table:
        """When the steps of an attempt (none given: of all) happened: a ``TIMING_SCHEMA`` table."""
        where, values = ("", ()) if attempt is None else (_THIS_ATTEMPT, attempt.key)
        order = "ORDER BY participant, rollout, attempt, step"
        return self._table(TIMING_SCHEMA, f"FROM timings AS t {where} {order}", *values)

    def read_labels(self, statuses: Collection[AttemptStatus] | None = None) -> pa.Table:
        """Labelled steps, by participant, rollout, attempt and step.

        Args:
            statuses: of the attempts wanted, all of them; None: of each rollout the participant's
                last finished attempt, the one that counts.

        Returns:
            A table of ``LABELLED_STEP_SCHEMA``; names sort by code point.
        """
        if statuses is None:
            attempts, values = _LAST_FINISHED, [AttemptStatus.FINISHED.value]
        else:
            values = [status.value for status in statuses]
            attempts = f"(SELECT * FROM attempts WHERE status IN ({', '.join('?' * len(values))}))"
        query = (
            f"FROM steps AS t JOIN {attempts} USING (participant, rollout, attempt) "
            f"ORDER BY t.participant, t.rollout, t.attempt, t.step"
        )
        return self._table(LABELLED_STEP_SCHEMA, query, *values)

    def steps(self, attempt: Attempt) -> pa.Table:
        """Steps of one attempt, whatever its status, in order: a ``LABELLED_STEP_SCHEMA`` table."""
        query = f"FROM steps AS t {_THIS_ATTEMPT} ORDER BY step"
        return self._table(LABELLED_STEP_SCHEMA, query, *attempt.key)

    def attempt_data(self, attempt: Attempt) -> AttemptData:
        """Everything that is kept about an attempt, whatever its status.

        Raises:
            StoreError: the store cannot be read.
        """
        steps = [step_from_row(row) for row in self.steps(attempt).to_pylist()]
        names = [field.name for field in fields(StepTiming)]
        times = {
            row["step"]: StepTiming(**{name: row[name] for name in names})
            for row in self.timings(attempt).to_pylist()
        }
        return AttemptData(
            rollout=self.rollouts()[attempt.rollout],
            attempt=attempt,
            session=None if attempt.session is None else self.sessions()[attempt.session],
            steps=steps,
            times=[times.get(step.step) for step in steps],
            events=self.events(attempt),
            flags=self.flags(attempt),
        )

    def _table(self, schema: pa.Schema, query: str, *values: str | int) -> pa.Table:
        """The rows of ``query`` from a table ``t`` that has the columns of ``schema``."""
        columns = ", ".join(f"t.{name}" for name in schema.names)
        try:
            cursor = self.connection.run(f"SELECT {columns} {query}", *values)
            return pa.Table.from_batches([*_batches(cursor, schema)], schema=schema)
        except sqlite3.Error as error:
            fail(self.path, "read the steps", error)

    def _check_session(self, session: str, participant: str) -> None:
        """Refuse a session that is not one of the participant's."""
        query = "SELECT participant FROM sessions WHERE id = ?"
        known = self.connection.read(query, session)
        if known != [(participant,)]:
            why = f"is one of {known[0][0]!r}" if known else "is not in the store"
            raise StoreError(
                f"Session {session!r} {why}, so {participant!r} has no attempt in it; add the "
                f"session first."
            )

    def _end(self, attempt: Attempt, status: AttemptStatus, reason: str | None = None) -> None:
        update = f"UPDATE attempts SET status = ?, end_reason = ? {_THIS_ATTEMPT}"
        if self.connection.run(update, status.value, reason, *attempt.key).rowcount != 1:
            raise StoreError(f"There is no {attempt} in {self.path}; begin it first.")
        why = f": {reason}" if reason else ""
        self.connection.log(f"attempt {status}", f"{attempt}{why}")
        seal(self.connection, "attempt", *attempt.key)


def _key(attempt: Attempt) -> dict[str, str | int]:
    return dict(zip(("participant", "rollout", "attempt"), attempt.key, strict=True))


def _batches(cursor: sqlite3.Cursor, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    while rows := cursor.fetchmany(_BATCH_ROWS):
        columns = dict(zip(schema.names, map(list, zip(*rows, strict=True)), strict=True))
        for field in schema:
            if field.type == pa.bool_():
                columns[field.name] = list(map(bool, columns[field.name]))
        yield pa.RecordBatch.from_pydict(columns, schema=schema)
