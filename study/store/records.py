"""What the study store keeps besides steps: rollouts, attempts and the audit, as typed records."""

import json
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from typing import Any, Self

from steerlab.sim.records import InvalidRecord, check_name
from steerlab.sim.rollout import Rollout
from steerlab.sim.world import WorldSpec


class AttemptStatus(StrEnum):
    """``RUNNING`` after a crash means: not finished, to be abandoned and redone."""

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
        """What tells it from all others."""
        return self.participant, self.rollout, self.attempt

    def __str__(self) -> str:
        return f"attempt {self.attempt} of {self.participant!r} at {self.rollout!r}"

    def to_row(self) -> tuple[str, str, int, str, int, str | None, str | None]:
        """Values of the table ``attempts``."""
        status, order_index = self.status.value, self.order_index
        return *self.key, status, order_index, self.session, self.end_reason

    @classmethod
    def from_row(cls, row: tuple[Any, ...]) -> Self:
        """The inverse of ``to_row``."""
        participant, rollout, attempt, status, order_index, session, end_reason = row
        return cls(
            participant=participant,
            rollout=rollout,
            attempt=attempt,
            status=AttemptStatus(status),
            order_index=order_index,
            session=session,
            end_reason=end_reason,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredRollout:
    """What the store keeps of a rollout besides its labelled steps.

    Attributes:
        seed, steps: None for a drive that comes into being live: each attempt at it is a drive of
            its own, as long as it lasts.

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

    def to_row(self) -> tuple[str, str, float, int | None, int | None]:
        """Values of the table ``rollouts``; the world as JSON, exact to the last bit."""
        world = json.dumps(self.world.to_dict(), sort_keys=True, allow_nan=False)
        return self.name, world, self.control_hz, self.seed, self.steps

    @classmethod
    def from_row(cls, row: tuple[Any, ...]) -> Self:
        """The inverse of ``to_row``."""
        name, world, control_hz, seed, steps = row
        spec = WorldSpec.from_dict(json.loads(world))
        return cls(name=name, world=spec, control_hz=control_hz, seed=seed, steps=steps)


@dataclass(frozen=True, kw_only=True, slots=True)
class AuditEntry:
    """One act, as it was logged; ``at_utc`` is ISO 8601."""

    at_utc: str
    act: str
    detail: str
