"""The mapper between records and rows: every stored record comes back, and errors name the place."""

import math
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import InvalidRecord
from steerlab.sim.world import Block, WorldSpec
from steerlab.study.store.answers import RESPONSES, Response
from steerlab.study.store.audit import AUDIT, AuditEntry
from steerlab.study.store.errors import StoreError
from steerlab.study.store.frozen import (
    EMBEDDINGS,
    INSTRUMENTS,
    MODELS,
    PROTOCOLS,
    FrozenModel,
    FrozenProtocol,
    Instrument,
    StoredEmbedding,
)
from steerlab.study.store.people import ENROLMENTS, PHASE_EVENTS, Enrolment, PhaseEvent
from steerlab.study.store.records import (
    ATTEMPTS,
    EVENTS,
    FLAGS,
    ROLLOUTS,
    SESSIONS,
    TIMINGS,
    Attempt,
    Event,
    Flag,
    SessionRecord,
    StoredRollout,
)
from steerlab.study.store.rows import Table
from steerlab.study.store.schema import SCHEMA
from steerlab.study.store.teaching import ROUNDS, TRIALS, TaughtRound, Trial
from steerlab.teleop.timing import StepTiming

text = st.text(st.characters(codec="utf-8"), max_size=12)
names = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=8)  # printable
counts = st.integers(0, 2**63 - 1)
finite = st.floats(allow_nan=False, allow_infinity=False)
rates = st.floats(0.1, 1e3)
by_type = {str: text, int: counts, float: finite}
texts = st.dictionaries(text, text, max_size=3)

worlds = st.builds(
    WorldSpec,
    name=names,
    ball_xy_m=st.tuples(st.floats(20.0, 25.0), st.floats(-9.0, 9.0)),
    start=st.builds(Pose2D, st.floats(-25.0, -20.0), st.floats(-9.0, 9.0), st.floats(-3.0, 3.0)),
    blocks=st.just(()) | st.tuples(st.builds(Block, *map(st.just, (1 / 3, 0.2, 1.5, 2.5)))),
)


def records(kind: type, **special):
    """Records with any value in each field, but for those that have to keep to something."""
    plain = {one.name: by_type[one.type] for one in fields(kind) if one.type in by_type}
    return st.builds(kind, **{**plain, **special})


positive = st.integers(1, 2**63 - 1)
shares = st.floats(0.0, 1e9)
STORED: dict[Table, st.SearchStrategy] = {
    ATTEMPTS: records(Attempt, session=st.none() | text, end_reason=st.none() | text),
    ROLLOUTS: records(
        StoredRollout,
        name=names,
        world=worlds,
        control_hz=rates,
        seed=st.none() | st.integers(-(2**63), 2**63 - 1),
        steps=st.none() | positive,
    ),
    SESSIONS: records(
        SessionRecord,
        **dict.fromkeys(("id", "participant", "started_utc", "input_kind", "device_name"), names),
        **dict.fromkeys(("device_details", "settings", "environment"), texts),
        screen_px=st.none() | st.tuples(positive, positive),
        display_hz=st.none() | rates,
        control_hz=rates,
        input_latency_ms=st.none() | shares,
    ),
    EVENTS: records(Event, what=names),
    TIMINGS: records(StepTiming, event_age_ns=st.none() | counts),
    FLAGS: records(Flag, name=names),
    AUDIT: records(AuditEntry, sha256=st.none() | text),
    PROTOCOLS: records(FrozenProtocol, version=positive),
    INSTRUMENTS: records(Instrument),
    ENROLMENTS: records(Enrolment, condition_order=st.lists(text, max_size=4).map(tuple)),
    PHASE_EVENTS: records(PhaseEvent),
    RESPONSES: records(
        Response, value=st.none() | text | st.integers(-(2**63), 2**63 - 1) | finite
    ),
    MODELS: records(
        FrozenModel, people=st.lists(text, max_size=4).map(tuple), removed_utc=st.none() | text
    ),
    EMBEDDINGS: records(
        StoredEmbedding,
        w=arrays(np.float64, 3, elements=finite),
        covariance=arrays(np.float64, (3, 3), elements=finite),
        distance=st.none() | finite,
    ),
    ROUNDS: records(
        TaughtRound,
        **dict.fromkeys(("label_mae", "given_mae", "loss"), st.none() | shares),
        policies=texts,
        mapper_sha256=st.none() | text,
    ),
    TRIALS: records(Trial),
}
OTHERS = {  # columns that a record does not have, since what it is kept for says them
    "events": {"participant": "p", "rollout": "r", "attempt": 0},
    "flags": {"participant": "p", "rollout": "r", "attempt": 0},
    "timings": {"participant": "p", "rollout": "r", "attempt": 0, "step": 0},
    "instruments": {"protocol_version": 1},
    "embeddings": {"at_utc": "now"},
    "teaching_rounds": {"at_utc": "now"},
    "teaching_trials": {"participant": "p", "phase": "t", "phase_run": 0, "round": 0},
}
UNMAPPED = {
    *("meta", "participants", "steps"),  # texts by key, and labelled steps, which map themselves
    *("departures", "consents", "links", "notes", "teaching_targets", "erasing"),  # no record
    "merged_audits",  # the records of audits, besides whose they are
}


@pytest.fixture(scope="module")
def database():
    """Every table as it is, with neither the rows that others refer to nor the triggers."""
    raw = sqlite3.connect(":memory:", isolation_level=None)
    raw.executescript(SCHEMA)
    for (name,) in raw.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        raw.execute(f"DROP TRIGGER {name}")
    yield raw
    raw.close()


class Connection:
    """As much of a ``StoreConnection`` as the mapper needs."""

    def __init__(self, raw: sqlite3.Connection) -> None:
        self.raw = raw

    def insert(self, table: str, **values) -> None:
        places = ", ".join("?" * len(values))
        statement = f"INSERT INTO {table} ({', '.join(values)}) VALUES ({places})"
        self.raw.execute(statement, tuple(values.values()))

    def read(self, query: str, *values):
        return self.raw.execute(query, values).fetchall()


def same(one: object, other: object) -> bool:
    """To the last digit and the type, so 1 is not 1.0; SQLite alone drops the sign of -0.0."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.tobytes() == other.tobytes()
    return type(one) is type(other) and one == other


@pytest.mark.parametrize("table", STORED, ids=lambda table: table.name)
@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_every_stored_record_comes_back(database, table: Table, data):
    record = data.draw(STORED[table])
    connection, others = Connection(database), OTHERS.get(table.name, {})
    database.execute("BEGIN")
    try:
        how = ""
        if table is ENROLMENTS:
            connection.insert("participants", pseudonym=record.participant, role=record.role)
            how = "JOIN participants ON pseudonym = participant"
        table.insert(connection, record, **others)
        (back,) = table.select(connection, how)
    finally:
        database.execute("ROLLBACK")
    for one in fields(record):
        assert same(getattr(record, one.name), getattr(back, one.name)), one.name


def test_every_table_is_mapped_or_named_here(database):
    rows = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    assert {name for (name,) in rows} == {table.name for table in STORED} | UNMAPPED
    for table in STORED:
        columns = {row[1] for row in database.execute(f"PRAGMA table_info({table.name})")}
        kept = {one.name for one in fields(table.record)} - set(table.joined)
        assert columns - {"id"} == (kept | set(OTHERS.get(table.name, ()))) - {"id"}, table.name


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Odd:
    whole: int = 1
    real: float = 0.5
    yes: bool = True
    raw: bytes = b"\x00\xff"
    word: str = "w"
    colour: Colour = Colour.RED
    pair: tuple[int, float] = (1, 2.0)
    table: Mapping[str, int] | None = None
    either: int | str | None = None


ODD = Table("odd", Odd)
NUMPY = {"whole": np.int64(1), "real": np.float32(0.5), "yes": np.True_}


def test_numpy_scalars_and_members_become_plain_values():
    row = ODD.to_row(replace(Odd(), word=Colour.RED, either=Colour.BLUE, **NUMPY))
    kinds = {type(value) for value in row.values()}
    assert kinds == {int, float, bool, bytes, str, type(None)}
    assert (row["word"], row["either"], row["colour"]) == ("red", '"blue"', "red")
    assert ODD.from_row(tuple(ODD.to_row(Odd()).values())) == Odd()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"whole": 1.5}, r"odd\.whole cannot be 1\.5 \(.*\); give int"),
        ({"whole": True}, r"odd\.whole cannot be True"),
        ({"whole": 2**63}, "no whole number of 64 bits"),
        ({"real": "1"}, r"odd\.real cannot be '1'"),
        ({"real": math.nan}, r"odd\.real cannot be nan \(no finite number\)"),
        ({"real": None}, r"odd\.real cannot be None"),
        ({"yes": 2}, "neither true nor false"),
        ({"raw": "text"}, r"odd\.raw cannot be 'text' \(no bytes\)"),
        ({"word": b"bytes"}, "no text"),
        ({"word": "\ud800"}, "surrogates not allowed"),
        ({"colour": "green"}, r"odd\.colour cannot be 'green' .*give one of red, blue"),
        ({"pair": (1,)}, r"odd\.pair cannot be \(1,\)"),
        ({"table": {"a": "b"}}, r"odd\.table cannot be \{'a': 'b'\}"),
        ({"table": {1: 1}}, "no text"),
        ({"either": 1.5}, r"odd\.either cannot be 1\.5 \(no int or str\)"),
        ({"either": math.inf}, "no int or str"),
    ],
)
def test_a_value_that_is_none_of_its_type_is_refused_by_name(change, said):
    with pytest.raises(InvalidRecord, match=said):
        ODD.to_row(replace(Odd(), **change))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"colour": "green"}, r"odd\.colour is 'green' in the database .*must be one of red, blue"),
        ({"yes": 2}, r"odd\.yes is 2 in the database"),
        ({"pair": "[1"}, r"odd\.pair is '\[1' in the database"),
        ({"pair": "[1, 2, 3]"}, r"odd\.pair is"),
        ({"pair": '{"a": 1}'}, r"odd\.pair is"),
        ({"table": "[1]"}, r"odd\.table is"),
        ({"word": None}, r"odd\.word is None in the database \(no text\), .*restore the study"),
    ],
)
def test_what_a_damaged_row_holds_is_told_by_name(change, said):
    row = {**ODD.to_row(Odd()), **change}
    with pytest.raises(StoreError, match=said):
        ODD.from_row(tuple(row.values()))


def test_a_world_that_is_none_is_told():
    row = ("r", '{"name": "w"}', 10.0, None, None)
    with pytest.raises(StoreError, match=r"rollouts\.world is .* in the database"):
        ROLLOUTS.from_row(row)
