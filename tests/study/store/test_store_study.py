"""What the store keeps of a study around the drives: it comes back, what is final stays, erasure."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.study.store.answers import insert_note, insert_response, read_notes, read_responses
from steerlab.study.store.audit import append_audit, broken_at, entry_sha256, read_audit
from steerlab.study.store.connection import connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.frozen import (
    Instrument,
    insert_model,
    insert_protocol,
    mark_model_removed,
    read_instruments,
    read_models,
    read_protocols,
)
from steerlab.study.store.people import (
    Departure,
    Enrolment,
    PhaseAct,
    erase_rows,
    insert_enrolment,
    insert_link,
    insert_phase_event,
    read_departures,
    read_enrolments,
    read_link_owner,
    read_phase_events,
    scrub,
)
from steerlab.study.store.store import StudyStore


@pytest.fixture
def store(tmp_path: Path):
    with StudyStore.create(tmp_path / "new.db") as store:
        with store.connection.transaction("set up"):
            insert_protocol(store.connection, sha256="a", text="t", why="w", instruments=[])
            for name in ("P001", "P002"):
                insert_enrolment(store.connection, enrolment(name))
        yield store


def enrolment(name: str) -> Enrolment:
    return Enrolment(
        participant=name,
        role="test",
        protocol_version=1,
        allocation="x",
        condition_order=("bc", "dagger"),
    )


@given(
    texts=st.lists(st.tuples(st.text(max_size=9), st.text(max_size=9)), min_size=2, max_size=6),
    data=st.data(),
)
@settings(max_examples=60, deadline=None)
def test_any_change_of_any_entry_breaks_the_chain(texts, data):
    with closing(sqlite3.connect(":memory:")) as raw:  # hypothesis may give an example up
        raw.execute("CREATE TABLE audit (id INTEGER PRIMARY KEY, at_utc, act, detail, sha256)")
        for act, detail in texts:
            append_audit(
                raw, act.encode(errors="replace").decode(), detail.encode(errors="replace").decode()
            )
        assert broken_at(read_audit(raw)) is None
        row = data.draw(st.integers(1, len(texts)))
        column = data.draw(st.sampled_from(["at_utc", "act", "detail", "sha256"]))
        raw.execute(f"UPDATE audit SET {column} = {column} || 'x' WHERE id = ?", (row,))
        assert broken_at(read_audit(raw)).id == row


def test_a_text_cannot_pass_for_two_fields():
    assert entry_sha256("", 1, "t", "ab", "c") != entry_sha256("", 1, "t", "a", "bc")


def test_enrolments_and_phases_come_back(store: StudyStore):
    connection = store.connection
    with connection.transaction("act"):
        insert_phase_event(connection, "P001", "pre", PhaseAct.STARTED)
        insert_phase_event(connection, "P001", "pre", PhaseAct.DONE, "all well")
        insert_phase_event(connection, "P002", "pre", PhaseAct.SKIPPED)
    assert [(one.participant, one.condition_order) for one in read_enrolments(connection)] == [
        ("P001", ("bc", "dagger")),
        ("P002", ("bc", "dagger")),
    ]
    acts = read_phase_events(connection, "P001")
    assert [(one.act, one.detail, one.first_attempt) for one in acts] == [
        (PhaseAct.STARTED, "", 0),
        (PhaseAct.DONE, "all well", 0),
    ]
    assert len(read_phase_events(connection)) == 3
    with pytest.raises(StoreError, match="taken already"), connection.transaction("enrol"):
        insert_enrolment(connection, enrolment("P001"))


def test_only_the_newest_link_of_a_person_counts(store: StudyStore):
    connection = store.connection
    with connection.transaction("link"):
        for participant, token in (("P001", "a"), ("P002", "b"), ("P001", "c")):
            insert_link(connection, participant, token)
    assert [read_link_owner(connection, token) for token in "abcd"] == [None, "P002", "P001", None]


def test_protocols_and_models_come_back_and_are_final(store: StudyStore):
    connection = store.connection
    one = Instrument(key="trust", version=2, sha256="s")
    with connection.transaction("freeze"):
        version = insert_protocol(
            connection, sha256="b", text="tt", why="better", instruments=[one]
        )
        insert_model(connection, file="m", sha256="h", people=["T001"], inputs="i")
    assert version == 2
    assert [(p.version, p.text, p.why) for p in read_protocols(connection)] == [
        (1, "t", "w"),
        (2, "tt", "better"),
    ]
    assert read_instruments(connection, 2) == {"trust": one}
    (model,) = read_models(connection)
    assert (model.people, model.removed_utc) == (("T001",), None)
    with connection.transaction("remove"):
        mark_model_removed(connection, model, "erased")
    assert read_models(connection)[0].removed_utc is not None
    with pytest.raises(StoreError, match="frozen"), connection.transaction("again"):
        mark_model_removed(connection, model, "twice")


def test_erasing_takes_one_person_and_leaves_the_other(store: StudyStore):
    connection = store.connection
    with connection.transaction("answer"):
        for participant in ("P001", "P002"):
            insert_response(
                connection,
                participant=participant,
                phase="pre",
                phase_run=0,
                questionnaire="q",
                item="i",
                value="Zanzibar " + participant,
            )
            insert_note(connection, participant, "Timbuktu " + participant)
    erase_rows(connection, "P001")
    scrub(connection)
    assert [one.participant for one in read_responses(connection)] == ["P002"]
    assert read_notes(connection, "P001") == []
    assert read_departures(connection) == {"P001": Departure.ERASING}
    raw = b"".join(path.read_bytes() for path in store.path.parent.iterdir())
    assert b"Zanzibar P002" in raw
    assert b"P001" in raw  # the tombstone
    assert b"Zanzibar P001" not in raw
    assert b"Timbuktu P001" not in raw
    assert broken_at(read_audit(connection.sqlite)) is None


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM responses",
        "DELETE FROM notes",
        "DELETE FROM departures",
        "DELETE FROM enrolments",
        "DELETE FROM protocols",
        "UPDATE responses SET value = '1'",
        "UPDATE protocols SET text = 'x'",
        "UPDATE enrolments SET condition_order = '[]'",
        "UPDATE phase_events SET act = 'done'",
        "UPDATE departures SET how = 'kept'",
        "UPDATE audit SET sha256 = 'x'",
        "INSERT OR REPLACE INTO responses SELECT * FROM responses",
        "INSERT OR REPLACE INTO notes SELECT * FROM notes",
        "INSERT OR REPLACE INTO protocols SELECT version, frozen_utc, sha256, 'x', why FROM protocols",
        "INSERT OR REPLACE INTO enrolments SELECT * FROM enrolments",
        "INSERT OR REPLACE INTO departures SELECT participant, at_utc, 'kept' FROM departures",
    ],
)
def test_nobody_else_changes_or_deletes(store: StudyStore, statement: str):
    connection = store.connection
    with connection.transaction("fill"):
        insert_note(connection, None, "about the study")
        insert_phase_event(connection, "P001", "pre", PhaseAct.STARTED)
        insert_response(
            connection,
            participant="P001",
            phase="pre",
            phase_run=0,
            questionnaire="q",
            item="i",
            value=3,
        )
    erase_rows(connection, "P002")
    raw = connect(store.path, read_only=False)
    with pytest.raises(sqlite3.IntegrityError):
        raw.execute(statement)
    raw.close()
