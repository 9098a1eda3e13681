"""The study store: round trips, what may not change, and what errors say."""

import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import (
    LABELLED_STEP_SCHEMA,
    Driver,
    InvalidRecord,
    LabelledStep,
    step_from_row,
)
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import Block, WorldSpec
from steerlab.study.store.connection import connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.records import Attempt, AttemptStatus, StoredRollout
from steerlab.study.store.store import StudyStore

WORLD = WorldSpec(
    name="world-0",
    ball_xy_m=(30.1, 0.2),
    start=Pose2D(-20.0, 1 / 3, 0.1),
    blocks=(Block(1.0, 2.0, 1.5, 2.5),),
)


def drive(name: str = "r0", steps: int = 3) -> StoredRollout:
    return StoredRollout(name=name, world=WORLD, control_hz=10.0, seed=7, steps=steps)


def step_of(attempt: Attempt, step: int, **changes: object) -> LabelledStep:
    plain = LabelledStep(
        participant=attempt.participant,
        rollout=attempt.rollout,
        attempt=attempt.attempt,
        step=step,
        t_s=step / 10,
        x_m=0.0,
        y_m=0.0,
        heading_rad=0.0,
        speed_mps=5.0,
        lateral_speed_mps=0.0,
        yaw_rate_radps=0.0,
        acceleration_x_mps2=0.0,
        acceleration_y_mps2=0.0,
        robot_wheel=0.25,
        teacher_label=0.5,
        oracle_label=0.75,
        executed_wheel=0.25,
        gate=Driver.ROBOT,
        label_valid=True,
    )
    return replace(plain, **changes)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[StudyStore]:
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant("P01", "seen")
        store.add_rollout(drive())
        yield store


def label(store: StudyStore, participant: str, rollout: str = "r0", steps: int = 3) -> Attempt:
    attempt = store.begin_attempt(participant, rollout)
    for step in range(steps):
        store.append(step_of(attempt, step))
    store.finish_attempt(attempt)
    return attempt


finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(min_size=1, max_size=10).filter(lambda text: text.isprintable() and text.strip())


@given(
    people=st.lists(names, min_size=1, max_size=3, unique=True),
    values=st.lists(st.tuples(finite, st.none() | finite, st.none() | finite), min_size=1),
    gate=st.sampled_from(Driver),
    valid=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_steps_come_back_exactly_and_in_order(
    tmp_path_factory: pytest.TempPathFactory,
    people: list[str],
    values: list[tuple[float, float | None, float | None]],
    gate: Driver,
    valid: bool,
):
    path = tmp_path_factory.mktemp("study") / "study.db"
    written: list[LabelledStep] = []
    with StudyStore.create(path) as store:
        store.add_rollout(drive(steps=len(values)))
        for person in people:
            store.add_participant(person, "seen")
            attempt = store.begin_attempt(person, "r0")
            for i in reversed(range(len(values))):  # kept in any order, read in one
                x_m, teacher, oracle = values[i]
                changes = {"x_m": x_m, "teacher_label": teacher, "oracle_label": oracle}
                step = step_of(attempt, i, gate=gate, label_valid=valid, **changes)
                store.append(step)
                written.append(step)
            store.finish_attempt(attempt)
    with StudyStore.open(path, read_only=True) as store:
        table = store.read_labels()
    assert table.schema.equals(LABELLED_STEP_SCHEMA, check_metadata=True)
    table.validate(full=True)
    wanted = sorted(written, key=lambda s: (s.participant, s.rollout, s.attempt, s.step))
    assert [step_from_row(row) for row in table.to_pylist()] == wanted


def test_an_empty_store_gives_an_empty_table(store: StudyStore):
    table = store.read_labels()
    assert table.num_rows == 0
    assert table.schema.equals(LABELLED_STEP_SCHEMA, check_metadata=True)


def test_people_and_rollouts_come_back(store: StudyStore, tmp_path: Path):
    store.add_participant("P01", "seen")
    store.add_rollout(drive())
    with StudyStore.open(tmp_path / "study.db") as again:
        assert again.participants() == {"P01": "seen"}
        assert again.rollouts() == {"r0": drive()}


def test_a_whole_rollout_is_stored_by_its_outline():
    steps = 4
    column = np.zeros(steps)
    whole = Rollout(
        name="r1",
        world=WORLD,
        control_hz=10.0,
        seed=3,
        outcome=Outcome.TIME_LIMIT,
        t_s=column,
        pose=np.zeros((steps, 3)),
        velocity=np.zeros((steps, 3)),
        acceleration=np.zeros((steps, 2)),
        robot_wheel=column,
        oracle_label=column,
        oracle_valid=np.ones(steps, dtype=bool),
        physics_state=np.zeros((steps, 5)),
    )
    assert StoredRollout.of(whole) == replace(drive("r1", 4), seed=3)


@pytest.mark.parametrize(
    "change", [{"control_hz": float("nan")}, {"steps": 0}, {"seed": 2**63}, {"name": "\n"}]
)
def test_a_rollout_out_of_range_is_refused(change: dict[str, object]):
    with pytest.raises(InvalidRecord):
        replace(drive(), **change)


def test_a_taken_name_is_refused(store: StudyStore):
    with pytest.raises(StoreError, match="enrolled as 'seen', not 'new'"):
        store.add_participant("P01", "new")
    with pytest.raises(StoreError, match="Another rollout is stored as 'r0'"):
        store.add_rollout(drive(steps=9))
    with pytest.raises(StoreError, match="'P99' is not enrolled"):
        store.begin_attempt("P99", "r0")
    with pytest.raises(StoreError, match=r"'r9' is not in .*\['r0'\]"):
        store.begin_attempt("P01", "r9")


def test_a_redo_is_a_new_attempt_and_the_old_one_stays(store: StudyStore):
    store.add_rollout(drive("r1"))
    first = store.begin_attempt("P01", "r0")
    store.append(step_of(first, 0))
    store.abandon_attempt(first, "redo")
    second = label(store, "P01")
    third = label(store, "P01", "r1")
    assert [(a.rollout, a.attempt, a.order_index) for a in store.attempts()] == [
        ("r0", 0, 0),
        ("r0", 1, 1),
        ("r1", 0, 2),
    ]
    assert store.attempts(AttemptStatus.ABANDONED) == [
        replace(first, status=AttemptStatus.ABANDONED, end_reason="redo")
    ]
    assert set(store.read_labels().column("attempt").to_pylist()) == {second.attempt, 0}
    assert store.read_labels().num_rows == 6
    assert store.read_labels([*AttemptStatus]).num_rows == 7
    assert third.status is AttemptStatus.RUNNING  # as it was begun; the store says what it is now


def test_of_a_drive_finished_twice_the_last_counts(store: StudyStore):
    label(store, "P01")
    second = label(store, "P01")
    store.add_participant("P02", "seen")
    label(store, "P02")
    store.append(step_of(store.begin_attempt("P02", "r0"), 0))  # running: it does not count
    table = store.read_labels()
    counted = set(
        zip(*(table.column(n).to_pylist() for n in ("participant", "attempt")), strict=True)
    )
    assert counted == {("P01", second.attempt), ("P02", 0)}
    assert store.read_labels([AttemptStatus.FINISHED]).num_rows == table.num_rows * 3 // 2


def test_an_attempt_without_all_its_steps_cannot_be_finished(store: StudyStore):
    attempt = store.begin_attempt("P01", "r0")
    store.append(step_of(attempt, 0))
    store.append(step_of(attempt, 2))
    with pytest.raises(StoreError, match="has 2 steps, the last is 2; its rollout has 3"):
        store.finish_attempt(attempt)
    assert store.attempts(AttemptStatus.RUNNING) == [attempt]
    store.append(step_of(attempt, 1))
    store.finish_attempt(attempt)


def test_an_ended_attempt_takes_no_step_and_ends_once(store: StudyStore):
    attempt = label(store, "P01")
    with pytest.raises(StoreError, match="the attempt is not running"):
        store.append(step_of(attempt, 3))
    with pytest.raises(StoreError, match="an attempt ends once"):
        store.abandon_attempt(attempt, "redo")
    with pytest.raises(StoreError, match="There is no attempt 5"):
        store.abandon_attempt(replace(attempt, attempt=5), "redo")


def test_a_step_is_kept_once(store: StudyStore):
    attempt = store.begin_attempt("P01", "r0")
    store.append(step_of(attempt, 0))
    with pytest.raises(StoreError, match=r"Cannot keep step 0 of .*UNIQUE"):
        store.append(step_of(attempt, 0, x_m=9.0))
    with pytest.raises(InvalidRecord, match="x_m is nan"):
        store.append(step_of(attempt, 1, x_m=float("nan")))
    assert store.read_labels([AttemptStatus.RUNNING]).column("x_m").to_pylist() == [0.0]


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE audit SET act = 'x'",
        "DELETE FROM audit",
        "INSERT OR REPLACE INTO audit SELECT * FROM audit",
        "UPDATE steps SET teacher_label = 0",
        "INSERT OR REPLACE INTO steps SELECT * FROM steps",
        "UPDATE attempts SET status = 'running'",
        "INSERT INTO attempts SELECT * FROM attempts",
        "INSERT OR REPLACE INTO attempts SELECT participant, rollout, attempt, 'abandoned', "
        "order_index, session, end_reason FROM attempts",
        "INSERT OR REPLACE INTO rollouts SELECT name, world, control_hz, 1, steps FROM rollouts",
        "UPDATE rollouts SET seed = 1",
        "DELETE FROM rollouts",
        "INSERT OR REPLACE INTO participants SELECT pseudonym, 'new' FROM participants",
        "UPDATE participants SET role = 'new'",
        "INSERT INTO meta VALUES ('schema_version', '0')",
        "DELETE FROM steps",
        "DELETE FROM attempts",
        "DELETE FROM participants",
    ],
)
def test_another_program_cannot_rewrite_the_record(store: StudyStore, statement: str):
    label(store, "P01")

    def all_of_it():
        people, drives = store.participants(), store.rollouts()
        return people, drives, store.attempts(), store.audit(), store.read_labels()

    before = all_of_it()
    other = connect(store.path, read_only=False)
    try:
        with pytest.raises(sqlite3.IntegrityError):
            other.execute(statement)
    finally:
        other.close()
    assert all_of_it() == before


def test_acts_are_logged_in_order(store: StudyStore):
    attempt = label(store, "P01")
    store.record("consent", "version 3")
    acts = [(entry.act, entry.detail) for entry in store.audit()]
    assert [act for act in acts if act[0] != "sealed"] == [
        ("attempt begun", str(attempt)),
        ("attempt finished", str(attempt)),
        ("consent", "version 3"),
    ]
    assert [act for act, _ in acts].index("sealed") == 2


def test_hostile_names_are_only_names(store: StudyStore):
    name = "P'; DROP TABLE steps; --"
    store.add_participant(name, "seen")
    label(store, name)
    assert store.read_labels().column("participant").to_pylist() == [name] * 3


@pytest.mark.parametrize("value", [5e-324, -1.7976931348623157e308, 0.1 + 0.2, 2.0**53 + 2])
def test_extreme_numbers_keep_every_bit(store: StudyStore, value: float):
    attempt = store.begin_attempt("P01", "r0")
    store.append(step_of(attempt, 0, teacher_label=value))
    (back,) = store.read_labels([AttemptStatus.RUNNING]).column("teacher_label").to_pylist()
    assert np.float64(back).tobytes() == np.float64(value).tobytes()
