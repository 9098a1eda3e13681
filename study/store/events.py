"""What the store keeps about how an attempt went: step times, events, and the limits it broke."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import pyarrow as pa

from steerlab.sim.records import InvalidRecord, LabelledStep, check_name
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.records import Attempt
from steerlab.study.store.tables import EVENT_COLUMNS, FLAG_COLUMNS, TIMING_COLUMNS

TIMING_SCHEMA = pa.schema(
    [
        pa.field("participant", pa.string(), nullable=False),
        pa.field("rollout", pa.string(), nullable=False),
        pa.field("attempt", pa.int32(), nullable=False),
        pa.field("step", pa.int32(), nullable=False),
        pa.field("deadline_ns", pa.int64(), nullable=False),
        pa.field("actual_ns", pa.int64(), nullable=False),
        pa.field("sample_ns", pa.int64(), nullable=False),
        pa.field("event_age_ns", pa.int64()),
        pa.field("overrun", pa.bool_(), nullable=False),
        pa.field("focus", pa.bool_(), nullable=False),
        pa.field("device_ok", pa.bool_(), nullable=False),
    ],
    metadata={"steerlab.schema": "StepTimes", "steerlab.schema_version": "1"},
)
"""When steps happened, a row a step; steps of scripted teachers have none."""

_THIS_ATTEMPT = "WHERE participant = ? AND rollout = ? AND attempt = ?"
_INSERT_TIMES = f"INSERT INTO timings VALUES ({', '.join('?' * len(TIMING_COLUMNS))})"


class StepTimes(Protocol):
    """Monotonic times of one control step, and what was true at that time."""

    @property
    def deadline_ns(self) -> int:
        """When the step was due."""
        ...

    @property
    def actual_ns(self) -> int:
        """When the loop woke for it."""
        ...

    @property
    def sample_ns(self) -> int:
        """When the device was read."""
        ...

    @property
    def event_age_ns(self) -> int | None:
        """Age of the device's last event then; None when it never had one."""
        ...

    @property
    def overrun(self) -> bool:
        """The step came so late that a display frame was lost."""
        ...

    @property
    def focus(self) -> bool:
        """The window had the keyboard's focus."""
        ...

    @property
    def device_ok(self) -> bool:
        """The device was connected and known."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """Something that happened at a step; ``at_ns`` is on the same clock as the step times."""

    step: int
    at_ns: int
    what: str

    def __post_init__(self) -> None:
        check_name("event", self.what)
        if self.step < 0:
            raise InvalidRecord(f"Event {self.what!r} at step {self.step}; steps start at 0.")


@dataclass(frozen=True, kw_only=True, slots=True)
class Flag:
    """A limit that an attempt broke: its labels are kept, and whoever reads them is told."""

    name: str
    value: float
    limit: float

    def __post_init__(self) -> None:
        check_name("flag", self.name)
        if not (isfinite(self.value) and isfinite(self.limit)):
            raise InvalidRecord(f"{self} is not finite; a flag has a value and its limit.")


def insert_times(connection: StoreConnection, step: LabelledStep, times: StepTimes) -> None:
    """Keep when a step happened; inside the step's own transaction."""
    age_ns = times.event_age_ns
    connection.run(
        _INSERT_TIMES,
        *(step.participant, step.rollout, int(step.attempt), int(step.step)),
        *(int(times.deadline_ns), int(times.actual_ns), int(times.sample_ns)),
        None if age_ns is None else int(age_ns),
        *(int(times.overrun), int(times.focus), int(times.device_ok)),
    )


def insert_event(connection: StoreConnection, attempt: Attempt, event: Event) -> None:
    """Keep something that happened; inside a transaction."""
    connection.run(
        f"INSERT INTO events ({', '.join(EVENT_COLUMNS)}) VALUES (?, ?, ?, ?, ?, ?)",
        *attempt.key,
        *(event.step, event.at_ns, event.what),
    )


def insert_flag(connection: StoreConnection, attempt: Attempt, flag: Flag) -> None:
    """Keep a limit that was broken; inside a transaction."""
    values = (*attempt.key, flag.name, float(flag.value), float(flag.limit))
    connection.run("INSERT INTO flags VALUES (?, ?, ?, ?, ?, ?)", *values)


def read_timings(connection: StoreConnection, attempt: Attempt | None) -> pa.Table:
    """Times of one attempt, or of all, in the order of their steps."""
    where, values = ("", ()) if attempt is None else (_THIS_ATTEMPT, attempt.key)
    query = (
        f"SELECT {', '.join(TIMING_COLUMNS)} FROM timings {where} "
        f"ORDER BY participant, rollout, attempt, step"
    )
    rows = connection.read(query, *values)
    columns = dict(zip(TIMING_COLUMNS, zip(*rows, strict=True), strict=True)) if rows else {}
    arrays = [
        pa.array(list(columns.get(field.name, ()))).cast(field.type) for field in TIMING_SCHEMA
    ]
    return pa.Table.from_arrays(arrays, schema=TIMING_SCHEMA)


def read_events(connection: StoreConnection, attempt: Attempt) -> list[Event]:
    """What happened in an attempt, in the order in which it was kept."""
    query = f"SELECT step, at_ns, what FROM events {_THIS_ATTEMPT} ORDER BY id"
    rows = connection.read(query, *attempt.key)
    return [Event(step=step, at_ns=at_ns, what=what) for step, at_ns, what in rows]


def read_flags(connection: StoreConnection, attempt: Attempt) -> list[Flag]:
    """The limits that an attempt broke, by name."""
    columns = ", ".join(FLAG_COLUMNS[3:])
    rows = connection.read(f"SELECT {columns} FROM flags {_THIS_ATTEMPT}", *attempt.key)
    return [Flag(name=name, value=value, limit=bound) for name, value, bound in rows]
