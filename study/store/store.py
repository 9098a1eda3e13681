"""The study store: one SQLite file that keeps every step, attempt and act of a study."""
# pyarrow ships no types, so strict mode would reject each of its names:
# pyright: reportUnknownMemberType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportMissingTypeStubs=false

import sqlite3
from collections.abc import Collection, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import pyarrow as pa

from steerlab.sim.records import COLUMNS, LabelledStep, check_name, row_from_step
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.events import (
    Event,
    Flag,
    StepTimes,
    insert_event,
    insert_flag,
    insert_times,
    read_events,
    read_flags,
    read_timings,
)
from steerlab.study.store.labels import read_labels, read_steps
from steerlab.study.store.records import Attempt, AttemptStatus, AuditEntry, StoredRollout
from steerlab.study.store.schema import StoreError, create_database, open_database
from steerlab.study.store.sessions import SessionRecord, add_session, check_session, read_sessions

_INSERT_STEP = f"INSERT INTO steps VALUES ({', '.join('?' * len(COLUMNS))})"
_THIS_ATTEMPT = "WHERE participant = ? AND rollout = ? AND attempt = ?"


class StudyStore:
    """An open study database; it belongs to the thread that opened it.

    A step is safe from a crash of this program once ``append`` returns, and a finished attempt
    from a power cut as well once ``finish_attempt`` returns. Nothing is ever overwritten.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self._connection = StoreConnection(connection, path)

    @property
    def connection(self) -> StoreConnection:
        """What the tables of a study (schema 3) are read and written through."""
        return self._connection

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
        with self._connection.transaction(f"enrol {pseudonym!r}"):
            known = self.participants().get(pseudonym, role)
            if known != role:
                raise StoreError(
                    f"{pseudonym!r} is enrolled as {known!r}, not {role!r}; choose another name."
                )
            self._connection.run(
                "INSERT INTO participants VALUES (?, ?) ON CONFLICT DO NOTHING", pseudonym, role
            )

    def add_rollout(self, rollout: StoredRollout) -> None:
        """Register a rollout; saying the same twice changes nothing.

        Raises:
            StoreError: another rollout has that name.
        """
        with self._connection.transaction(f"add rollout {rollout.name!r}"):
            known = self.rollouts().get(rollout.name, rollout)
            if known != rollout:
                raise StoreError(
                    f"Another rollout is stored as {rollout.name!r} (seed {known.seed}, "
                    f"{known.steps} steps); give this one another name."
                )
            insert = "INSERT INTO rollouts VALUES (?, ?, ?, ?, ?) ON CONFLICT DO NOTHING"
            self._connection.run(insert, *rollout.to_row())

    def add_session(self, session: SessionRecord) -> None:
        """Keep when and with what a participant sat down; durable when this returns.

        Raises:
            StoreError: its id is taken, or its participant is not enrolled.
        """
        add_session(self._connection, session)

    def begin_attempt(
        self, participant: str, rollout: str, *, session: str | None = None
    ) -> Attempt:
        """Open the next attempt of a participant at a rollout: 0, then 1 for a redo, and so on.

        Raises:
            StoreError: the participant, the rollout or the session is not in the store.
        """
        with self._connection.transaction(f"begin an attempt of {participant!r} at {rollout!r}"):
            if participant not in self.participants():
                raise StoreError(f"{participant!r} is not enrolled in {self.path}; add them first.")
            if rollout not in (known := self.rollouts()):
                raise StoreError(f"{rollout!r} is not in {self.path}; it has {[*known]}.")
            if session is not None:
                check_session(self._connection, session, participant)
            tries = [a for a in self.attempts() if a.participant == participant]
            begun = Attempt(
                participant=participant,
                rollout=rollout,
                attempt=sum(a.rollout == rollout for a in tries),
                status=AttemptStatus.RUNNING,
                order_index=len(tries),
                session=session,
            )
            insert = "INSERT INTO attempts VALUES (?, ?, ?, ?, ?, ?, ?)"
            self._connection.run(insert, *begun.to_row())
            self._connection.log("attempt begun", str(begun))
        return begun

    def append(self, step: LabelledStep, times: StepTimes | None = None) -> None:
        """Keep one step of a running attempt, and when it happened.

        Raises:
            StoreError: its attempt is not running, or has that step already.
            InvalidRecord: a number is NaN or infinite, or a text is unusable.
        """
        values = tuple(row_from_step(step).values())
        with self._connection.transaction(f"keep step {step.step} of {step.rollout!r}"):
            self._connection.run(_INSERT_STEP, *values)
            if times is not None:
                insert_times(self._connection, step, times)

    def add_event(self, attempt: Attempt, event: Event) -> None:
        """Keep something that happened in a running attempt.

        Raises:
            StoreError: the attempt is not running.
        """
        with self._connection.transaction(f"keep {event.what!r} of {attempt}"):
            insert_event(self._connection, attempt, event)

    def finish_attempt(self, attempt: Attempt, flags: Sequence[Flag] = ()) -> None:
        """Mark an attempt as finished; durable against a power cut when this returns.

        Args:
            flags: the limits that it broke.

        Raises:
            StoreError: the attempt lacks steps of its rollout, or is not running.
        """
        with self._connection.transaction(f"finish {attempt}", durable=True):
            for flag in flags:
                insert_flag(self._connection, attempt, flag)
            self._end(attempt, AttemptStatus.FINISHED)
            count = f"SELECT count(*), max(step) FROM steps {_THIS_ATTEMPT}"
            kept, last = self._connection.run(count, *attempt.key).fetchone()
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
        with self._connection.transaction(f"abandon {attempt}", durable=True):
            self._end(attempt, AttemptStatus.ABANDONED, reason)

    def abandon_running(self, reason: str) -> list[Attempt]:
        """Abandon whatever a crash left running, so that it is redone; nothing kept is lost.

        Returns:
            the attempts that were found running.
        """
        found = self.attempts(AttemptStatus.RUNNING)
        for attempt in found:
            self.abandon_attempt(attempt, reason)
        return found

    def record(self, act: str, detail: str) -> None:
        """Add an act to the audit, which only grows; durable when this returns."""
        with self._connection.transaction(f"log {act!r}", durable=True):
            self._connection.log(check_name("act", act), detail)

    def participants(self) -> dict[str, str]:
        """Role by pseudonym."""
        return dict(
            self._connection.read("SELECT pseudonym, role FROM participants ORDER BY pseudonym")
        )

    def rollouts(self) -> dict[str, StoredRollout]:
        """Rollouts by name."""
        rows = self._connection.read(
            "SELECT name, world, control_hz, seed, steps FROM rollouts ORDER BY name"
        )
        return {row[0]: StoredRollout.from_row(row) for row in rows}

    def attempts(self, *statuses: AttemptStatus) -> list[Attempt]:
        """Attempts of the given statuses (none given: all), by participant in their order."""
        columns = "participant, rollout, attempt, status, order_index, session, end_reason"
        query = f"SELECT {columns} FROM attempts ORDER BY participant, order_index"
        found = map(Attempt.from_row, self._connection.read(query))
        return [a for a in found if not statuses or a.status in statuses]

    def sessions(self) -> dict[str, SessionRecord]:
        """Sessions by id, in the order in which they began."""
        return read_sessions(self._connection)

    def timings(self, attempt: Attempt | None = None) -> pa.Table:
        """When the steps of an attempt (none given: of all) happened: a ``TIMING_SCHEMA`` table."""
        return read_timings(self._connection, attempt)

    def events(self, attempt: Attempt) -> list[Event]:
        """What happened in an attempt, in order."""
        return read_events(self._connection, attempt)

    def flags(self, attempt: Attempt) -> list[Flag]:
        """The limits of timing that an attempt broke, by name."""
        return read_flags(self._connection, attempt)

    def audit(self) -> list[AuditEntry]:
        """Everything that was logged, in the order it was."""
        rows = self._connection.read("SELECT at_utc, act, detail FROM audit ORDER BY id")
        return [AuditEntry(at_utc=at_utc, act=act, detail=detail) for at_utc, act, detail in rows]

    def read_labels(self, statuses: Collection[AttemptStatus] | None = None) -> pa.Table:
        """Labelled steps, by participant, rollout, attempt and step.

        Args:
            statuses: of the attempts wanted, all of them; None: of each rollout the participant's
                last finished attempt, the one that counts.

        Returns:
            A table of ``LABELLED_STEP_SCHEMA``; names sort by code point.
        """
        return read_labels(self._connection, statuses)

    def steps(self, attempt: Attempt) -> pa.Table:
        """Steps of one attempt, whatever its status, in order: a ``LABELLED_STEP_SCHEMA`` table."""
        return read_steps(self._connection, attempt)

    def _end(self, attempt: Attempt, status: AttemptStatus, reason: str | None = None) -> None:
        update = f"UPDATE attempts SET status = ?, end_reason = ? {_THIS_ATTEMPT}"
        if self._connection.run(update, status.value, reason, *attempt.key).rowcount != 1:
            raise StoreError(f"There is no {attempt} in {self.path}; begin it first.")
        why = f": {reason}" if reason else ""
        self._connection.log(f"attempt {status}", f"{attempt}{why}")
