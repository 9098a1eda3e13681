"""What the store keeps of teaching: rounds, the labels that were imitated, trials of each policy."""
# pyarrow ships no types:
# pyright: reportMissingTypeStubs=false

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
import pyarrow as pa

from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.records import InvalidRecord
from steerlab.sim.rollout import Outcome
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.people import PhaseAct, read_enrolments
from steerlab.study.store.rows import Table
from steerlab.study.store.seals import seal

TEACHING_SCHEMA = pa.schema(
    [
        pa.field("participant", pa.string(), nullable=False),
        pa.field("phase", pa.string(), nullable=False),
        pa.field("position", pa.int32(), nullable=False),
        pa.field("condition", pa.string(), nullable=False),
        pa.field("round", pa.int32(), nullable=False),
        pa.field("success", pa.float64()),
        pa.field("final_distance_m", pa.float64()),
        pa.field("trials", pa.int32(), nullable=False),
        pa.field("label_mae", pa.float64()),
        pa.field("given_mae", pa.float64()),
        pa.field("labels_asked", pa.int32(), nullable=False),
        pa.field("teacher_s", pa.float64(), nullable=False),
        pa.field("switches", pa.int32(), nullable=False),
        pa.field("loss", pa.float64()),
    ],
    metadata={"steerlab.schema": "TeachingRounds", "steerlab.schema_version": "1"},
)
"""A row for each participant, condition and round that counts; round 0 is the first drive.

``position`` counts the conditions in the participant's order, from 1; ``success`` the share of
``trials`` in which the round's policy reached the ball, null before it was tried;
``final_distance_m`` the mean of them. ``label_mae`` is the mean error of what was imitated,
``given_mae`` of what the person gave at the same steps; null where nothing was asked.
"""

TRIALS_SCHEMA = pa.schema(
    [
        *(TEACHING_SCHEMA.field(name) for name in ("participant", "phase", "condition", "round")),
        pa.field("start", pa.int32(), nullable=False),
        pa.field("outcome", pa.string(), nullable=False),
        pa.field("final_distance_m", pa.float64(), nullable=False),
    ]
)
"""A row for each evaluation drive of a round that counts, from the ``start``-th start."""
_COUNTS = (
    "r.phase_run = (SELECT count(*) FROM phase_events AS e WHERE "
    "e.participant = r.participant AND e.phase = r.phase AND e.act = ?)"
)
"""Rounds of a phase that was opened again do not count."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TaughtRound:
    """One round as it was taught; see ``RoundResult`` of the learners for most of it.

    Attributes:
        phase_run: how often the phase was reopened before.
        attempt: at ``rollout``, which it was taught from.
        given_mae: as ``label_mae``, of the labels as they were given.
        loss: None where nothing was asked, so that the policy stayed as it was.
        policies: sha256 of each policy's file, by its name within the study's folder.
        mapper_sha256: of the mapper's file; None if labels were not mapped.
    """

    participant: str
    phase: str
    phase_run: int
    condition: str
    round: int
    rollout: str
    attempt: int
    outcome: Outcome
    labels_asked: int
    label_mae: float | None
    given_mae: float | None
    teacher_s: float
    switches: int
    loss: float | None
    training_s: float
    policies: Mapping[str, str]
    mapper_sha256: str | None

    def __post_init__(self) -> None:
        for name in ("label_mae", "given_mae", "loss", "teacher_s", "training_s"):
            value = getattr(self, name)
            if value is not None and not isfinite(value):
                raise InvalidRecord(
                    f"Round {self.round}: {name} is {value}; None if there is none."
                )


@dataclass(frozen=True, slots=True, eq=False)
class StoredTargets:
    """What was imitated of an attempt, (decisions,) each; ``target`` is NaN where there is none."""

    step: np.ndarray
    target: FloatArray
    weight: FloatArray
    asked: BoolArray


@dataclass(frozen=True, kw_only=True, slots=True)
class Trial:
    """How one evaluation drive of a round's policy ended, from the ``start``-th start."""

    start: int
    outcome: Outcome
    final_distance_m: float


ROUNDS = Table("teaching_rounds", TaughtRound)
TRIALS = Table("teaching_trials", Trial)
_ROUND_KEY = ("participant", "phase", "phase_run", "round")


def insert_round(connection: StoreConnection, taught: TaughtRound, targets: StoredTargets) -> None:
    """Keep a round and what was imitated; inside a transaction."""
    id_ = connection.next_id("teaching_rounds")
    ROUNDS.insert(connection, taught, id=id_, at_utc=connection.now())
    attempt = {name: getattr(taught, name) for name in ("participant", "rollout", "attempt")}
    for step, target, weight, asked in zip(
        *(targets.step.tolist(), targets.target.tolist()),
        *(targets.weight.tolist(), targets.asked.tolist()),
        strict=True,
    ):
        kept = target if isfinite(target) else None
        values = {"step": step, "target": kept, "weight": weight, "asked": int(asked)}
        connection.insert("teaching_targets", **attempt, **values)
    connection.log("round taught", f"{taught.participant} {taught.phase} round {taught.round}")
    seal(connection, "round", id_)


def insert_trials(
    connection: StoreConnection, taught: TaughtRound, trials: Sequence[Trial]
) -> None:
    """Keep how a round's policy drove; inside a transaction."""
    key = {name: getattr(taught, name) for name in _ROUND_KEY}
    for trial in trials:
        TRIALS.insert(connection, trial, **key)


def read_phase_run(connection: StoreConnection, participant: str, phase: str) -> tuple[int, int]:
    """How often a phase was reopened, and the first of the participant's attempts that counts."""
    rows = connection.read(
        "SELECT count(*), max(first_attempt) FROM phase_events "
        "WHERE participant = ? AND phase = ? AND act = ?",
        *(participant, phase, PhaseAct.REOPENED.value),
    )
    return rows[0][0], rows[0][1] or 0


def read_taught(connection: StoreConnection, participant: str, phase: str) -> list[TaughtRound]:
    """The rounds of a phase that count, in order."""
    phase_run, _ = read_phase_run(connection, participant, phase)
    where = "WHERE participant = ? AND phase = ? AND phase_run = ? ORDER BY round"
    return ROUNDS.select(connection, where, participant, phase, phase_run)


def read_targets(connection: StoreConnection, taught: TaughtRound) -> StoredTargets:
    """What was imitated in a round."""
    rows = connection.read(
        "SELECT step, target, weight, asked FROM teaching_targets "
        "WHERE participant = ? AND rollout = ? AND attempt = ? ORDER BY step",
        *(taught.participant, taught.rollout, taught.attempt),
    )
    step, target, weight, asked = zip(*rows, strict=True) if rows else ((), (), (), ())
    return StoredTargets(
        step=np.array(step, dtype=np.int64),
        target=np.array(target, dtype=np.float64),  # null becomes NaN
        weight=np.array(weight, dtype=np.float64),
        asked=np.array(asked, dtype=bool),
    )


def read_tried(connection: StoreConnection, participant: str, phase: str) -> set[int]:
    """The rounds of a phase whose policies were tried."""
    phase_run, _ = read_phase_run(connection, participant, phase)
    rows = connection.read(
        "SELECT DISTINCT round FROM teaching_trials "
        "WHERE participant = ? AND phase = ? AND phase_run = ?",
        *(participant, phase, phase_run),
    )
    return {row[0] for row in rows}


def read_teaching_rounds(connection: StoreConnection) -> pa.Table:
    """All rounds that count, by participant, position and round: a ``TEACHING_SCHEMA`` table.

    Rounds of a phase that was opened again do not count.
    """
    enrolled = read_enrolments(connection)
    orders = {person.participant: person.condition_order for person in enrolled}
    values = connection.read(
        "SELECT r.participant, r.phase, r.condition, r.round, "
        "avg(t.outcome = ?), avg(t.final_distance_m), count(t.start), r.label_mae, r.given_mae, "
        "r.labels_asked, r.teacher_s, r.switches, r.loss "
        "FROM teaching_rounds AS r LEFT JOIN teaching_trials AS t "
        "ON t.participant = r.participant AND t.phase = r.phase AND t.phase_run = r.phase_run "
        "AND t.round = r.round "
        f"WHERE {_COUNTS} GROUP BY r.id",
        *(Outcome.BALL_REACHED.value, PhaseAct.REOPENED.value),
    )
    names = [name for name in TEACHING_SCHEMA.names if name != "position"]
    rows = [dict(zip(names, row, strict=True)) for row in values]
    for row in rows:
        order = orders.get(row["participant"], ())
        row["position"] = order.index(row["condition"]) + 1 if row["condition"] in order else 0
    rows.sort(key=lambda row: (row["participant"], row["position"], row["phase"], row["round"]))
    return pa.Table.from_pylist(rows, schema=TEACHING_SCHEMA)


def read_teaching_trials(connection: StoreConnection) -> pa.Table:
    """The evaluation drives of all rounds that count: a ``TRIALS_SCHEMA`` table."""
    values = connection.read(
        "SELECT r.participant, r.phase, r.condition, r.round, t.start, t.outcome, "
        "t.final_distance_m FROM teaching_rounds AS r JOIN teaching_trials AS t "
        "ON t.participant = r.participant AND t.phase = r.phase AND t.phase_run = r.phase_run "
        f"AND t.round = r.round WHERE {_COUNTS} "
        "ORDER BY r.participant, r.phase, r.round, t.start",
        PhaseAct.REOPENED.value,
    )
    rows = [dict(zip(TRIALS_SCHEMA.names, row, strict=True)) for row in values]
    return pa.Table.from_pylist(rows, schema=TRIALS_SCHEMA)
