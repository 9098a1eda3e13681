"""How a study was conducted: orders, durations, devices and timing, as a methods section gives them."""
# pyarrow.compute makes its functions when it is imported:
# pyright: reportAttributeAccessIssue=false

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.analysis.study_data.phase_times import phase_times
from steerlab.study.contract import PhaseKind
from steerlab.study.progress import ParticipantProgress
from steerlab.study.store.records import Attempt, SessionRecord
from steerlab.study.study_folder import OpenStudy
from steerlab.teleop.timing_limits import NS_PER_MS

Counted = Sequence[tuple[ParticipantProgress, dict[str, Attempt]]]
"""The participants who count, each with the attempts that count, by rollout."""
SCRIPTED = "scripted"
"""The input kind of a script."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PhaseDuration:
    """How long a phase took those people who finished it, breaks included.

    Attributes:
        times: of each person, and of each condition where a phase is done once for each.
    """

    title: str
    times: int
    median_s: float
    shortest_s: float
    longest_s: float


@dataclass(frozen=True, kw_only=True, slots=True)
class StepsKept:
    """How the control steps of the attempts that count kept time.

    Attributes:
        late_p50_ms, late_p99_ms, late_max_ms: from a step's deadline to its start.
    """

    steps: int
    overruns: int
    late_p50_ms: float
    late_p99_ms: float
    late_max_ms: float


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """What happened, of those who count. Durations and timing are of people, never of scripts.

    Attributes:
        conditions, block_size, seed: of the protocol: what the orders of conditions are drawn from.
        rounds: of each condition after its first drive, as planned.
        blind: the experimenter was not shown which condition came when.
        condition_orders: how many test participants had each order; none if none taught.
        rollouts: that everyone corrected; ``rollout_orders`` in how many different orders.
        devices: participants by what they steered with, ``wheel: G29``.
        control_hz: rates of the sessions.
        steps: None where no step of a person has a time.
        attempts: that count; ``flags`` how many of them broke each limit.
    """

    conditions: tuple[str, ...]
    block_size: int
    seed: int
    rounds: int
    blind: bool
    condition_orders: Mapping[tuple[str, ...], int]
    rollouts: int
    rollout_orders: int
    phases: tuple[PhaseDuration, ...]
    devices: Mapping[str, int]
    control_hz: tuple[float, ...]
    steps: StepsKept | None
    attempts: int
    flags: Mapping[str, int]


def conduct_of(study: OpenStudy, counted: Counted, scripted: frozenset[str]) -> Conduct:
    """How the study went for those who count; ``scripted`` are the scripts among them."""
    protocol, known = study.current(), study.store.sessions()
    attempts = [attempt for _, of_person in counted for attempt in of_person.values()]
    sessions = {
        person.view.id: [known[a.session] for a in of_person.values() if a.session in known]
        for person, of_person in counted
    }
    orders = [
        tuple(sorted(of_person, key=lambda name: of_person[name].order_index))
        for _, of_person in counted
    ]
    used = [one for several in sessions.values() for one in several]
    taught = [person for person, _ in counted if person.of_kind(PhaseKind.TEACH) is not None]
    of_people = [person for person, _ in counted if person.view.id not in scripted]
    return Conduct(
        conditions=tuple(condition.key for condition in protocol.conditions),
        block_size=protocol.block_size,
        seed=protocol.seed,
        rounds=protocol.demonstrations,
        blind=protocol.design.blind,
        condition_orders=Counter(person.view.order for person in taught),
        rollouts=max((len(order) for order in orders), default=0),
        rollout_orders=len(set(orders)),
        phases=_durations(of_people),
        devices=Counter(
            name
            for several in sessions.values()
            for name in sorted({_steered_with(one) for one in several})
        ),
        control_hz=tuple(sorted({one.control_hz for one in used})),
        steps=_steps(study, [a for a in attempts if a.participant not in scripted]),
        attempts=len(attempts),
        flags=Counter(flag.name for attempt in attempts for flag in study.store.flags(attempt)),
    )


def _steered_with(session: SessionRecord) -> str:
    kind = session.input_kind
    return kind if kind == SCRIPTED else f"{kind}: {session.device_name}"


def _durations(people: Sequence[ParticipantProgress]) -> tuple[PhaseDuration, ...]:
    took: dict[str, list[float]] = {}
    for person in people:
        for phase, state in person.view.phases:
            seconds = phase_times(person, phase, state).duration_s
            if seconds is not None:
                of_each = phase.condition is None
                title = (
                    phase.title if of_each else phase.title.rpartition(" of ")[0].rpartition(" ")[0]
                )
                took.setdefault(title, []).append(seconds)
    return tuple(
        PhaseDuration(
            title=title,
            times=len(seconds),
            median_s=float(np.median(seconds)),
            shortest_s=min(seconds),
            longest_s=max(seconds),
        )
        for title, seconds in took.items()
    )


def _steps(study: OpenStudy, attempts: Sequence[Attempt]) -> StepsKept | None:
    tables = [study.store.timings(attempt) for attempt in attempts]
    late = [
        (table["actual_ns"].to_numpy() - table["deadline_ns"].to_numpy()) / NS_PER_MS
        for table in tables
        if table.num_rows
    ]
    if not late:
        return None
    together = np.concatenate(late)
    p50, p99 = np.percentile(together, (50, 99)).tolist()
    return StepsKept(
        steps=len(together),
        overruns=sum(int(np.sum(table["overrun"].to_numpy())) for table in tables),
        late_p50_ms=p50,
        late_p99_ms=p99,
        late_max_ms=float(together.max()),
    )
