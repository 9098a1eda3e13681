"""Merging forgets no table and no kind of seal, whatever is added to them."""

import sqlite3

import pytest

from steerlab.study.store import seals
from steerlab.study.store.errors import StoreError
from steerlab.study.store.merging import _AFTER_THE_END, _BEFORE_THE_END, _TABLE_OF, take_in
from steerlab.study.store.schema import SCHEMA
from steerlab.study.store.store import StudyStore

TAKEN_OTHERWISE = {
    *("participants", "enrolments", "rollouts"),
    "audit",  # kept beside the own one
    *("meta", "protocols", "instruments"),  # equal, or the first study's
    "erasing",  # always empty
}


def test_every_table_is_taken_in():
    made = sqlite3.connect(":memory:")
    made.executescript(SCHEMA)
    tables = {
        name for (name,) in made.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
    }
    made.close()
    copied = [*_BEFORE_THE_END, *_AFTER_THE_END]
    assert len(set(copied)) == len(copied)
    assert {*copied} | TAKEN_OTHERWISE == tables
    assert not {*copied} & TAKEN_OTHERWISE


def test_every_kind_of_seal_is_made_anew():
    assert set(_TABLE_OF) == {*seals._QUERIES, seals.ANSWER}


def test_nothing_is_added_if_a_row_has_its_like_here(tmp_path):
    for name in ("one.db", "other.db"):
        with StudyStore.create(tmp_path / name) as store:
            store.add_participant("P01", "seen")
            store.record("said", name)
    with StudyStore.open(tmp_path / "one.db") as store:
        before = store.audit()
        with pytest.raises(StoreError, match="participants are append only"):
            take_in(store.connection, tmp_path / "other.db")
        assert store.audit() == before
        with pytest.raises(StoreError, match="Cannot read the study in"):
            take_in(store.connection, tmp_path / "missing.db")
