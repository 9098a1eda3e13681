"""What the store keeps of drives, as typed records."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import isfinite
from typing import Self

import pyarrow as pa

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import InvalidRecord, LabelledStep, check_name
from steerlab.sim.rollout import Rollout
from steerlab.sim.world import WorldSpec
from steerlab.study.store.rows import Table
from steerlab.teleop.timing import StepTiming

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
    metadata={"steerlab.schema": "StepTiming", "steerlab.schema_version": "1"},
)
"""When steps happened, a row a step; steps of scripted teachers have none."""


class AttemptStatus(StrEnum):
    """How far an attempt got; one that a crash left ``RUNNING`` is abandoned and redone."""

    RUNNING = "running"
    FINISHED = "finished"
    ABANDONED = "abandoned"


@dataclass(frozen=True, kw_only=True, slots=True)
class Attempt:
    """One try of one participant at one rollout.

    Attributes:
        order_index: counts that person's tries at any rollout.
        session: in which it was made; None where that is not known.
        end_reason: why it was abandoned; None otherwise.
    """

    participant: str
    rollout: str
    attempt: int
    status: AttemptStatus
    order_index: int
    session: str | None = None
    end_reason: str | None = None

    @property
    def key(self) -> tuple[str, str, int]:
        """Participant, rollout and number, which identify it."""
        return self.participant, self.rollout, self.attempt

    def __str__(self) -> str:
        return f"attempt {self.attempt} of {self.participant!r} at {self.rollout!r}"


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredRollout:
    """What the store keeps of a rollout besides its labelled steps.

    Attributes:
        world: kept as JSON, exact to the last bit.
        seed, steps: None for a live drive: each attempt at it is another drive of another length.

    Raises:
        InvalidRecord: the name is unusable, or a number is out of range.
    """

    name: str
    world: WorldSpec
    control_hz: float
    seed: int | None
    steps: int | None

    def __post_init__(self) -> None:
        check_name("rollout name", self.name)
        if not (isfinite(self.control_hz) and self.control_hz > 0.0):
            raise InvalidRecord(f"Rollout {self.name!r}: control_hz {self.control_hz} is no rate.")
        if self.steps is not None and self.steps < 1:
            raise InvalidRecord(f"Rollout {self.name!r} has {self.steps} steps; give one or more.")
        if self.seed is not None and not -(2**63) <= self.seed < 2**63:
            raise InvalidRecord(f"Rollout {self.name!r}: seed {self.seed} does not fit 64 bits.")

    @classmethod
    def of(cls, rollout: Rollout) -> Self:
        """The stored part of a whole rollout."""
        return cls(
            name=rollout.name,
            world=rollout.world,
            control_hz=float(rollout.control_hz),
            seed=int(rollout.seed),
            steps=rollout.steps,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class SessionRecord:
    """One session of one participant; attempts name the session that they were made in.

    Attributes:
        started_utc: ISO 8601.
        input_kind: what steered: wheel, keyboard, ...; labels of different kinds are not pooled.
        device_guid, profile_sha256: empty where there is none.
        force_feedback: ``off: why``, or what was on.
        device_details: whatever else identifies the device.
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
    """A limit of timing that an attempt broke; its labels are kept all the same.

    Attributes:
        bound: the limit that ``value`` broke.
    """

    name: str
    value: float
    bound: float

    def __post_init__(self) -> None:
        check_name("flag", self.name)
        if not (isfinite(self.value) and isfinite(self.bound)):
            raise InvalidRecord(f"{self} is not finite; a flag has a value and its bound.")


@dataclass(frozen=True, kw_only=True)
class AttemptData:
    """Everything that the store keeps about one attempt.

    Attributes:
        session: in which it was made; None where that was not recorded.
        times: of each step, None where there is none, as for scripted teachers.
    """

    rollout: StoredRollout
    attempt: Attempt
    session: SessionRecord | None
    steps: Sequence[LabelledStep]
    times: Sequence[StepTiming | None]
    events: Sequence[Event]
    flags: Sequence[Flag]

    @property
    def start(self) -> Pose2D:
        """Where the attempt began: its first step, or the world's start before there is one."""
        if not self.steps:
            return self.rollout.world.start
        first = self.steps[0]
        return Pose2D(first.x_m, first.y_m, first.heading_rad)


ATTEMPTS = Table("attempts", Attempt)
ROLLOUTS = Table("rollouts", StoredRollout)
SESSIONS = Table("sessions", SessionRecord)
EVENTS = Table("events", Event)
FLAGS = Table("flags", Flag)
TIMINGS = Table("timings", StepTiming)
