"""Sessions: when a participant sat down, with which device, on what screen, with what software."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Self

from steerlab.sim.records import InvalidRecord, check_name
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.schema import StoreError
from steerlab.study.store.tables import SESSION_COLUMNS


@dataclass(frozen=True, kw_only=True, slots=True)
class SessionRecord:
    """One sitting of one participant; attempts name the session that they were made in.

    Attributes:
        started_utc: ISO 8601.
        input_kind: what steered: wheel, keyboard, ...; never pooled silently.
        device_guid, profile_sha256: empty where there is none.
        force_feedback: ``off: why``, or what was on.
        device_details: whatever else tells devices apart.
        screen_px: width and height; None without a screen, as for scripted teachers.
        display_hz: None without a screen.
        input_latency_ms: from the hand to the sample, as measured; None where it was not.
        settings: of the protocol that labels may depend on, such as whether the robot's wheel was
            shown.
        environment: versions and processor; nothing that names a machine or a person.

    Raises:
        InvalidRecord: a text is unusable, or a number is out of range.
    """

    id: str
    participant: str
    started_utc: str
    input_kind: str
    device_name: str
    device_guid: str = ""
    profile_sha256: str = ""
    force_feedback: str = "off: not asked for"
    device_details: Mapping[str, str] = field(default_factory=dict)
    screen_px: tuple[int, int] | None = None
    display_hz: float | None = None
    control_hz: float
    input_latency_ms: float | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    steerlab_version: str
    environment: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("id", "participant", "started_utc", "input_kind", "device_name"):
            check_name(f"session {name}", getattr(self, name))
        for name in ("control_hz", "display_hz"):
            rate = getattr(self, name)
            if rate is not None and not (isfinite(rate) and rate > 0.0):
                raise InvalidRecord(f"Session {self.id!r}: {name} {rate} is no rate.")
        latency = self.input_latency_ms
        if latency is not None and not (isfinite(latency) and latency >= 0.0):
            raise InvalidRecord(
                f"Session {self.id!r}: input_latency_ms is {latency}; None if it was not measured."
            )
        if self.screen_px is not None and min(self.screen_px) < 1:
            raise InvalidRecord(f"Session {self.id!r}: a screen of {self.screen_px} pixels.")

    def to_row(self) -> tuple[Any, ...]:
        """Values of the table ``sessions``; mappings as JSON."""
        width_px, height_px = self.screen_px or (None, None)
        return (
            self.id,
            self.participant,
            self.started_utc,
            self.input_kind,
            self.device_name,
            self.device_guid,
            self.profile_sha256,
            self.force_feedback,
            _json(self.device_details),
            width_px,
            height_px,
            self.display_hz,
            self.control_hz,
            self.input_latency_ms,
            _json(self.settings),
            self.steerlab_version,
            _json(self.environment),
        )

    @classmethod
    def from_row(cls, row: tuple[Any, ...]) -> Self:
        """The inverse of ``to_row``."""
        values: dict[str, Any] = dict(zip(SESSION_COLUMNS, row, strict=True))
        width_px, height_px = values.pop("screen_width_px"), values.pop("screen_height_px")
        values["screen_px"] = None if width_px is None else (width_px, height_px)
        for name in ("device_details", "settings", "environment"):
            values[name] = json.loads(values[name])
        return cls(**values)


def add_session(connection: StoreConnection, session: SessionRecord) -> None:
    """Keep a session; durable when this returns.

    Raises:
        StoreError: its id is taken, or its participant is not enrolled.
    """
    places = ", ".join("?" * len(SESSION_COLUMNS))
    with connection.transaction(f"keep session {session.id!r}", durable=True):
        connection.run(f"INSERT INTO sessions VALUES ({places})", *session.to_row())
        connection.log("session begun", f"session {session.id!r} of {session.participant!r}")


def read_sessions(connection: StoreConnection) -> dict[str, SessionRecord]:
    """Sessions by id, in the order in which they began."""
    names = ", ".join(SESSION_COLUMNS)
    rows = connection.read(f"SELECT {names} FROM sessions ORDER BY started_utc, id")
    return {row[0]: SessionRecord.from_row(row) for row in rows}


def check_session(connection: StoreConnection, session: str, participant: str) -> None:
    """Whether an attempt of ``participant`` may belong to ``session``.

    Raises:
        StoreError: there is no such session, or it is another participant's.
    """
    known = connection.read("SELECT participant FROM sessions WHERE id = ?", session)
    if known != [(participant,)]:
        whose = f"is one of {known[0][0]!r}" if known else "is not in the store"
        raise StoreError(
            f"Session {session!r} {whose}, so {participant!r} has no attempt in it; add the "
            f"session first."
        )


def _json(values: Mapping[str, str]) -> str:
    return json.dumps(dict(values), sort_keys=True, ensure_ascii=False)
