"""Everything that the store keeps about one attempt, read in one go."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import LabelledStep, step_from_row
from steerlab.study.store.records import Attempt, Event, Flag, SessionRecord, StoredRollout
from steerlab.study.store.store import StudyStore
from steerlab.teleop.timing import StepTiming


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


def read_attempt(store: StudyStore, attempt: Attempt) -> AttemptData:
    """Read an attempt, whatever its status.

    Raises:
        StoreError: the store cannot be read.
    """
    steps = [step_from_row(row) for row in store.steps(attempt).to_pylist()]
    times = {row["step"]: _timing(row) for row in store.timings(attempt).to_pylist()}
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


def _timing(row: dict[str, Any]) -> StepTiming:
    return StepTiming(**{one.name: row[one.name] for one in fields(StepTiming)})
