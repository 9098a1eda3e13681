"""What was taught, in the store: kept whole, never changed, read by what counts, gone when erased."""

import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, InvalidRecord, LabelledStep
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import WorldSpec
from steerlab.study.store.errors import StoreError
from steerlab.study.store.people import (
    Enrolment,
    PhaseAct,
    erase_rows,
    insert_enrolment,
    insert_phase_event,
)
from steerlab.study.store.records import StoredRollout
from steerlab.study.store.seals import sealed_rows
from steerlab.study.store.store import StudyStore
from steerlab.study.store.teaching import (
    TEACHING_SCHEMA,
    StoredTargets,
    TaughtRound,
    Trial,
    insert_round,
    insert_trials,
    read_phase_run,
    read_targets,
    read_taught,
    read_teaching_rounds,
    read_tried,
)

TABLES = ("teaching_trials", "teaching_targets", "teaching_rounds")
TARGETS = StoredTargets(
    step=np.array([0, 2]),
    target=np.array([0.1 + 0.2, np.nan]),
    weight=np.array([1.0, 0.0]),
    asked=np.array([True, False]),
)
ROUND = TaughtRound(
    participant="P001",
    phase="teach-1",
    phase_run=0,
    condition="dagger",
    round=0,
    rollout="drive",
    attempt=0,
    outcome=Outcome.BALL_REACHED,
    labels_asked=1,
    label_mae=0.25,
    given_mae=None,
    teacher_s=0.1,
    switches=0,
    loss=None,
    training_s=0.5,
    policies={"models/policies/a.safetensors": "ab" * 32},
    mapper_sha256=None,
)
TRIALS = [
    Trial(start=0, outcome=Outcome.BALL_REACHED, final_distance_m=3.0),
    Trial(start=1, outcome=Outcome.BLOCK_HIT, final_distance_m=9.0),
]


@pytest.fixture
def store(tmp_path):
    with StudyStore.create(tmp_path / "study.db") as store:
        connection = store.connection
        world = WorldSpec(name="flat", ball_xy_m=(10.0, 0.0), start=Pose2D(0.0, 0.0, 0.0))
        with connection.transaction("prepare"):
            connection.run("INSERT INTO protocols VALUES (1, 'now', 'x', 'x', 'x')")
            for name in ("P001", "P002"):
                order = ("bc", "dagger")
                insert_enrolment(
                    connection,
                    Enrolment(
                        participant=name,
                        role="test",
                        protocol_version=1,
                        allocation="a",
                        condition_order=order,
                    ),
                )
        store.add_rollout(
            StoredRollout(name="drive", world=world, control_hz=20.0, seed=None, steps=None)
        )
        for name in ("P001", "P002"):
            attempt = store.begin_attempt(name, "drive")
            for step in range(4):
                store.append(a_step(name, step))
            store.finish_attempt(attempt)
        yield store


def a_step(participant: str, step: int) -> LabelledStep:
    numbers = dict.fromkeys(
        (
            *("x_m", "y_m", "heading_rad", "speed_mps", "lateral_speed_mps", "yaw_rate_radps"),
            *("acceleration_x_mps2", "acceleration_y_mps2", "robot_wheel", "executed_wheel"),
        ),
        0.0,
    )
    return LabelledStep(
        participant=participant,
        rollout="drive",
        attempt=0,
        step=step,
        t_s=step / 20.0,
        teacher_label=0.5,
        oracle_label=None,
        gate=Driver.ROBOT,
        label_valid=True,
        **numbers,
    )


def keep(store, taught=ROUND, targets=TARGETS, trials=()):
    with store.connection.transaction("keep a round", durable=True):
        insert_round(store.connection, taught, targets)
        insert_trials(store.connection, taught, trials)


def test_a_round_comes_back_as_it_was(store):
    keep(store)
    assert read_taught(store.connection, "P001", "teach-1") == [ROUND]
    assert read_taught(store.connection, "P001", "teach-2") == []
    found = read_targets(store.connection, ROUND)
    for name in ("step", "target", "weight", "asked"):
        np.testing.assert_array_equal(getattr(found, name), getattr(TARGETS, name))
    assert read_tried(store.connection, "P001", "teach-1") == set()
    with store.connection.transaction("try"):
        insert_trials(store.connection, ROUND, TRIALS)
    assert read_tried(store.connection, "P001", "teach-1") == {0}
    assert ("round taught", "P001 teach-1 round 0") in [
        (entry.act, entry.detail) for entry in store.audit()
    ]


def test_the_table_has_a_row_a_round_with_the_mean_of_its_trials(store):
    keep(store, trials=TRIALS)
    keep(store, replace(ROUND, round=1, loss=0.5, given_mae=0.75), targets=NOTHING)
    keep(store, replace(ROUND, participant="P002", condition="bc", phase="teach-2"))
    table = read_teaching_rounds(store.connection)
    assert table.schema.equals(TEACHING_SCHEMA, check_metadata=True)
    rows = table.to_pylist()
    assert [(row["participant"], row["position"], row["round"]) for row in rows] == [
        ("P001", 2, 0),
        ("P001", 2, 1),
        ("P002", 1, 0),
    ]
    assert (rows[0]["success"], rows[0]["final_distance_m"], rows[0]["trials"]) == (0.5, 6.0, 2)
    assert (rows[1]["success"], rows[1]["final_distance_m"], rows[1]["trials"]) == (None, None, 0)
    assert (rows[1]["label_mae"], rows[1]["given_mae"]) == (0.25, 0.75)


NOTHING = StoredTargets(*(np.array([])[:0] for _ in range(4)))


def test_rounds_of_a_phase_that_was_opened_again_do_not_count(store):
    keep(store, trials=TRIALS)
    with store.connection.transaction("open again"):
        insert_phase_event(store.connection, "P001", "teach-1", PhaseAct.REOPENED)
    assert read_phase_run(store.connection, "P001", "teach-1") == (1, 1)
    assert read_taught(store.connection, "P001", "teach-1") == []
    assert read_tried(store.connection, "P001", "teach-1") == set()
    assert read_teaching_rounds(store.connection).num_rows == 0
    again = replace(ROUND, phase_run=1, label_mae=0.125)
    keep(store, again, targets=NOTHING)
    assert read_taught(store.connection, "P001", "teach-1") == [again]
    assert read_teaching_rounds(store.connection)["label_mae"].to_pylist() == [0.125]


def test_nothing_that_was_taught_is_changed_or_written_over(store):
    keep(store, trials=TRIALS)
    with pytest.raises(StoreError, match="UNIQUE"):
        keep(store, targets=NOTHING)
    for table in TABLES:
        for act in (
            f"UPDATE {table} SET participant = 'P002'",
            f"DELETE FROM {table}",
            f"INSERT OR REPLACE INTO {table} SELECT * FROM {table}",
        ):
            with pytest.raises(sqlite3.IntegrityError):
                store.connection.sqlite.execute(act)
    with pytest.raises(InvalidRecord, match="None if there is none"):
        replace(ROUND, loss=float("nan"))


def test_a_target_belongs_to_a_step_and_a_trial_to_a_round(store):
    stray = StoredTargets(np.array([77]), np.ones(1), np.ones(1), np.array([True]))
    with pytest.raises(StoreError, match="FOREIGN KEY"):
        keep(store, targets=stray)
    with (
        pytest.raises(StoreError, match="FOREIGN KEY"),
        store.connection.transaction("try"),
    ):
        insert_trials(store.connection, replace(ROUND, round=5), TRIALS)
    assert read_taught(store.connection, "P001", "teach-1") == []


def test_all_of_a_person_goes_when_they_are_erased_and_nobody_elses(store):
    keep(store, trials=TRIALS)
    keep(store, replace(ROUND, participant="P002"), trials=TRIALS)
    erase_rows(store.connection, "P001")
    for table in TABLES:
        found = store.connection.read(f"SELECT DISTINCT participant FROM {table}")
        assert found == [("P002",)]
    sealed = [row for row in sealed_rows(store.audit()) if row[0] == "round"]
    assert sealed == [("round", 2)]  # the audit knows whose went: that of P002 would be missed
