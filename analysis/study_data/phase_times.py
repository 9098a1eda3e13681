"""When the phases of a study were done, and how long they took."""

from dataclasses import dataclass
from datetime import datetime

from steerlab.study.contract import Phase, PhaseKind, PhaseState
from steerlab.study.progress import ParticipantProgress
from steerlab.study.store.people import PhaseAct

TIMED = (
    PhaseKind.QUESTIONNAIRES,
    PhaseKind.PRACTICE,
    PhaseKind.CALIBRATION,
    PhaseKind.CALIBRATE_W,
    PhaseKind.TEACH,
)
"""Kinds of phases whose beginning is on record: the first answer, or the start at the wheel."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PhaseTimes:
    """When a phase was done, the last time.

    Attributes:
        started_utc: None before it, and of kinds whose beginning is not on record.
        duration_s: from the first answer, or the start at the wheel, to the end; breaks included.
    """

    phase: Phase
    state: PhaseState
    times_reopened: int
    started_utc: str | None
    done_utc: str | None
    duration_s: float | None


def phase_times(person: ParticipantProgress, phase: Phase, state: PhaseState) -> PhaseTimes:
    """Of one phase of one person."""
    acts = list(person.acts.get(phase.id, ()))
    reopened = [index for index, act in enumerate(acts) if act.act is PhaseAct.REOPENED]
    acts = acts[reopened[-1] + 1 :] if reopened else acts
    started = [act.at_utc for act in acts if act.act is PhaseAct.STARTED]
    done = [act.at_utc for act in acts if act.act is PhaseAct.DONE]
    first = started[0] if started and phase.kind in TIMED else None
    last = done[-1] if done else None
    took = None
    if first is not None and last is not None:
        took = (datetime.fromisoformat(last) - datetime.fromisoformat(first)).total_seconds()
    return PhaseTimes(
        phase=phase,
        state=state,
        times_reopened=len(reopened),
        started_utc=first,
        done_utc=last,
        duration_s=took,
    )
