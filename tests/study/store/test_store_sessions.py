"""Sessions, step times, events and flags: round trips, and that they stay as they are."""

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, InvalidRecord, LabelledStep
from steerlab.sim.world import WorldSpec
from steerlab.study.store.connection import connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.people import erase_rows
from steerlab.study.store.records import TIMING_SCHEMA, Event, Flag, SessionRecord, StoredRollout
from steerlab.study.store.store import StudyStore
from steerlab.teleop.timing import StepTiming

WORLD = WorldSpec(name="w", ball_xy_m=(9.0, 0.0), start=Pose2D(-9.0, 0.0, 0.0))
LIVE = StoredRollout(name="live", world=WORLD, control_hz=20.0, seed=None, steps=None)
STEP = LabelledStep(
    participant="P01", rollout="live", attempt=0, step=0, t_s=0.0, x_m=0.0, y_m=0.0,
    heading_rad=0.0, speed_mps=5.0, lateral_speed_mps=0.0, yaw_rate_radps=0.0, acceleration_x_mps2=0.0,
    acceleration_y_mps2=0.0, robot_wheel=0.0, teacher_label=0.5, oracle_label=None,
    executed_wheel=0.0, gate=Driver.TEACHER, label_valid=True,
)  # fmt: skip
SESSION = SessionRecord(
    id="P01-1",
    participant="P01",
    started_utc="2026-01-02T03:04:05+00:00",
    input_kind="wheel",
    device_name="G29",
    control_hz=20.0,
    steerlab_version="0.1.0",
)


TIMES = StepTiming(
    deadline_ns=10,
    actual_ns=11,
    sample_ns=12,
    event_age_ns=3,
    overrun=False,
    focus=True,
    device_ok=True,
)


@pytest.fixture
def store(tmp_path: Path):
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant("P01", "seen")
        store.add_participant("P02", "seen")
        store.add_rollout(LIVE)
        store.add_session(SESSION)
        yield store


names = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=8)  # printable
texts = st.dictionaries(names, st.text(st.characters(codec="utf-8"), max_size=8), max_size=3)
rates = st.floats(0.1, 1e3)
ns = st.integers(-(2**63), 2**63 - 1)
finite = st.floats(allow_nan=False, allow_infinity=False)


@given(
    session=st.builds(
        replace,
        st.just(SESSION),
        id=names,
        input_kind=names,
        device_name=names,
        device_guid=st.text(st.characters(codec="utf-8"), max_size=8),
        device_details=texts,
        screen_px=st.none() | st.tuples(st.integers(1, 8000), st.integers(1, 8000)),
        display_hz=st.none() | rates,
        control_hz=rates,
        input_latency_ms=st.none() | st.floats(0.0, 1e3),
        settings=texts,
        environment=texts,
    ),
    times=st.lists(
        st.builds(
            StepTiming,
            **dict.fromkeys(("deadline_ns", "actual_ns", "sample_ns"), ns),
            event_age_ns=st.none() | ns,
        ),
        min_size=1,
        max_size=4,
    ),
    events=st.lists(st.builds(Event, step=st.integers(0, 2**31), at_ns=ns, what=names)),
    flags=st.lists(
        st.builds(Flag, name=names, value=finite, bound=finite), unique_by=lambda f: f.name
    ),
)
@settings(max_examples=30, deadline=None)
def test_everything_comes_back(tmp_path_factory, session, times, events, flags):
    path = tmp_path_factory.mktemp("study") / "study.db"
    with StudyStore.create(path) as store:
        store.add_participant("P01", "seen")
        store.add_rollout(LIVE)
        store.add_session(session)
        attempt = store.begin_attempt("P01", "live", session=session.id)
        for step, when in enumerate(times):
            store.append(replace(STEP, step=step), when)
        for event in events:
            store.add_event(attempt, event)
        store.finish_attempt(attempt, flags)
    with StudyStore.open(path, read_only=True) as store:
        (kept,) = store.attempts()
        assert store.rollouts() == {"live": LIVE}
        assert store.sessions() == {session.id: session}
        assert kept.session == session.id
        table = store.timings(kept)
        assert table.schema.equals(TIMING_SCHEMA, check_metadata=True)
        rows = [
            {k: v for k, v in row.items() if k in StepTiming.__slots__} for row in table.to_pylist()
        ]
        assert [StepTiming(**row) for row in rows] == times
        assert store.timings().equals(table)
        assert store.events(kept) == events
        assert store.flags(kept) == sorted(flags, key=lambda flag: flag.name)


@pytest.mark.parametrize(
    "change",
    [
        {"id": " "},
        {"control_hz": 0.0},
        {"display_hz": float("nan")},
        {"input_latency_ms": -1.0},
        {"screen_px": (0, 540)},
        {"device_name": "a\nb"},
    ],
)
def test_a_session_out_of_range_is_refused(change):
    with pytest.raises(InvalidRecord):
        replace(SESSION, **change)


def test_a_flag_or_event_out_of_range_is_refused():
    with pytest.raises(InvalidRecord, match="not finite"):
        Flag(name="lateness", value=float("inf"), bound=1.0)
    with pytest.raises(InvalidRecord, match="steps start at 0"):
        Event(step=-1, at_ns=0, what="pause")


def test_a_session_belongs_to_one_person_and_is_kept_once(store):
    with pytest.raises(StoreError, match="there is a session with this id"):
        store.add_session(replace(SESSION, device_name="G920"))
    with pytest.raises(StoreError, match="FOREIGN KEY"):
        store.add_session(replace(SESSION, id="x", participant="P99"))
    with pytest.raises(StoreError, match="is one of 'P01', so 'P02' has no attempt in it"):
        store.begin_attempt("P02", "live", session="P01-1")
    with pytest.raises(StoreError, match="is not in the store"):
        store.begin_attempt("P01", "live", session="P01-9")
    assert store.attempts() == []


def test_a_live_drive_needs_all_its_steps_and_at_least_one(store):
    attempt = store.begin_attempt("P01", "live")
    with pytest.raises(StoreError, match="has 0 steps"):
        store.finish_attempt(attempt)
    store.append(replace(STEP, step=1))
    with pytest.raises(StoreError, match="has 1 steps, the last is 1"):
        store.finish_attempt(attempt)
    store.append(STEP)
    store.finish_attempt(attempt)


def test_a_step_and_its_times_are_kept_together(store):
    store.begin_attempt("P01", "live")
    with pytest.raises(InvalidRecord, match=r"timings\.overrun cannot be 2"):
        store.append(STEP, replace(TIMES, overrun=2))
    assert store.steps(store.attempts()[0]).num_rows == 0


@pytest.mark.parametrize("during", [True, False])
@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE sessions SET input_kind = 'keyboard'",
        "INSERT OR REPLACE INTO sessions SELECT * FROM sessions",
        "UPDATE timings SET overrun = 0",
        "INSERT OR REPLACE INTO timings SELECT * FROM timings",
        "UPDATE events SET what = 'x'",
        "INSERT OR REPLACE INTO events SELECT * FROM events",
        "UPDATE flags SET value = 0",
        "INSERT OR REPLACE INTO flags SELECT * FROM flags",
        "UPDATE attempts SET session = NULL",
        "INSERT INTO flags VALUES ('P01', 'nowhere', 0, 'late', 1, 2)",
    ],
)
def test_another_program_cannot_rewrite_the_record(store, statement, during):
    attempt = store.begin_attempt("P01", "live", session="P01-1")
    store.append(STEP, TIMES)
    store.add_event(attempt, Event(step=0, at_ns=0, what="pause"))
    with store.connection.transaction("flag"):
        store.connection.run("INSERT INTO flags VALUES ('P01', 'live', 0, 'late', 3, 2)")
    if not during:
        store.finish_attempt(attempt)

    def all_of_it():
        return (
            store.sessions(), store.attempts(), store.timings(), store.events(attempt),
            store.flags(attempt),
        )  # fmt: skip

    before = all_of_it()
    other = connect(store.path, read_only=False)
    try:
        with pytest.raises(sqlite3.IntegrityError):
            other.execute(statement)
    finally:
        other.close()
    assert all_of_it() == before


def test_an_ended_attempt_takes_nothing_more(store):
    attempt = store.begin_attempt("P01", "live")
    store.append(STEP)
    store.abandon_attempt(attempt, "redo")
    with pytest.raises(StoreError, match="the attempt is not running"):
        store.add_event(attempt, Event(step=0, at_ns=0, what="late"))
    with pytest.raises(StoreError, match="the attempt is not running"):
        store.append(replace(STEP, step=1), TIMES)
    with pytest.raises(InvalidRecord, match="reason"):
        store.abandon_attempt(attempt, " ")


def test_what_was_running_is_abandoned_with_its_reason(store):
    assert store.abandon_running("a crash") == []
    one, two = store.begin_attempt("P01", "live"), store.begin_attempt("P02", "live")
    assert store.abandon_running("a crash") == [one, two]
    assert {a.end_reason for a in store.attempts()} == {"a crash"}
    assert [e.detail for e in store.audit() if e.act == "attempt abandoned"] == [
        f"{one}: a crash",
        f"{two}: a crash",
    ]


def test_all_of_a_person_who_sat_at_a_wheel_is_erased(store):
    for who in ("P01", "P02"):
        attempt = store.begin_attempt(who, "live", session="P01-1" if who == "P01" else None)
        store.append(replace(STEP, participant=who), TIMES)
        store.add_event(attempt, Event(step=0, at_ns=0, what="pause"))
        store.finish_attempt(attempt, [Flag(name="late", value=3.0, bound=2.0)])
    erase_rows(store.connection, "P01")
    assert store.sessions() == {}
    for table in ("attempts", "steps", "timings", "events", "flags"):
        found = store.connection.read(f"SELECT DISTINCT participant FROM {table}")
        assert found == [("P02",)], table
