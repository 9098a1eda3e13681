"""Everything that the store keeps about one attempt, read in one go."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import LabelledStep, step_from_row
from steerlab.study.store.events import Event, Flag, StepTimes
from steerlab.study.store.records import Attempt, StoredRollout
from steerlab.study.store.sessions import SessionRecord
from steerlab.study.store.store import StudyStore


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredTimes:
    """When a stored step happened; see ``StepTimes``."""

    deadline_ns: int
    actual_ns: int
    sample_ns: int
    event_age_ns: int | None
    overrun: bool
    focus: bool
    device_ok: bool


@dataclass(frozen=True, kw_only=True)
class AttemptData:
    """One attempt.

    Attributes:
        times: of each step, None where there is none, as for scripted teachers.
        session: in which it was made; None where that was not recorded.
    """

    rollout: StoredRollout
    attempt: Attempt
    session: SessionRecord | None
    steps: Sequence[LabelledStep]
    times: Sequence[StepTimes | None]
    events: Sequence[Event]
    flags: Sequence[Flag]

    @property
    def start(self) -> Pose2D:
        """Where the attempt began: its first step, or the world's start before there is one."""
        if not self.steps:
            return self.rollout.world.start
        first = self.steps[0]
        return Pose2D(first.x_m, first.y_m, first.heading_rad)


def read_attempt(store: StudyStore, attempt: Attempt) -> AttemptData:
    """Read an attempt, whatever its status.

    Raises:
        StoreError: the store cannot be read.
    """
    steps = [step_from_row(row) for row in store.steps(attempt).to_pylist()]
    times = {row["step"]: _times(row) for row in store.timings(attempt).to_pylist()}
    sessions = store.sessions()
    return AttemptData(
        rollout=store.rollouts()[attempt.rollout],
        attempt=attempt,
        session=None if attempt.session is None else sessions[attempt.session],
        steps=steps,
        times=[times.get(step.step) for step in steps],
        events=store.events(attempt),
        flags=store.flags(attempt),
    )


def _times(row: dict[str, Any]) -> StoredTimes:
    return StoredTimes(**{name: row[name] for name in StoredTimes.__slots__})
