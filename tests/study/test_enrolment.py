"""Enrolment: pseudonyms, orders, the frozen protocol, and programs that enrol at once."""

import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import closing
from hashlib import sha256
from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.errors import InvalidValue
from steerlab.study.contract import PhaseState, Role, Standing, StudyError
from steerlab.study.enrolment import order_at
from steerlab.study.runner import RunConfig
from steerlab.study.store.connection import connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.frozen import read_protocols
from steerlab.study.store.schema import STORE_VERSION
from steerlab.study.store.store import StudyStore
from steerlab.study.study import Study


def test_the_program_chooses_pseudonyms_and_orders(study):
    training = [study.enrol(Role.TRAINING) for _ in range(3)]
    test = [study.enrol(Role.TEST) for _ in range(12)]
    assert [one.id for one in training] == ["T001", "T002", "T003"]
    assert [one.id for one in test[:2]] == ["P001", "P002"]
    assert all(one.order == () for one in training)
    for block in (test[:6], test[6:]):
        assert len({one.order for one in block}) == 6
    assert [view.id for view in study.participants()] == [one.id for one in training + test]
    assert test[0].standing is Standing.ENROLLED
    assert {state for _, state in test[0].phases} == {PhaseState.WAITING}
    assert test[0].next_phase.id == "consent"
    with pytest.raises(StudyError, match=r"'P099' is not enrolled; enrolled are: T001"):
        study.participant("P099")


def test_a_form_that_comes_again_does_nothing_again(study, folder):
    first = study.enrol(Role.TEST, form="a" * 64)
    study.note(first.id, "late", form="b" * 64)
    study.close()
    with Study.open(folder) as later:  # the key outlives the program
        count = later.change_count()
        assert later.enrol(Role.TEST, form="a" * 64) == first
        later.note(first.id, "late", form="b" * 64)
        assert later.change_count() == count
        assert later.enrol(Role.TEST, form="c" * 64).id == "P002"
        assert later.enrol(Role.TEST).id == "P003"
        assert len(later.notes(first.id)) == 1
        assert later.verify().ok


def test_a_redo_that_comes_again_is_no_error_and_opens_nothing(trained):
    with Study.open(trained) as study:
        study.redo("T001", "about-you", form="d" * 64)
        count = study.change_count()
        study.redo("T001", "about-you", form="d" * 64)
        assert study.change_count() == count
        with pytest.raises(StudyError, match="is not over yet"):
            study.redo("T001", "about-you", form="e" * 64)


def test_the_same_protocol_gives_the_same_orders(study, tmp_path, folder):
    (tmp_path / "other").mkdir()
    text = (folder / "study.toml").read_text()
    (tmp_path / "other" / "study.toml").write_text(text)
    StudyStore.create(tmp_path / "other" / "study.db").close()
    with Study.open(tmp_path / "other") as other:
        assert [study.enrol(Role.TEST).order for _ in range(8)] == [
            other.enrol(Role.TEST).order for _ in range(8)
        ]


def test_a_number_is_never_given_twice(study):
    first = study.enrol(Role.TEST)
    second = study.enrol(Role.TEST)
    study.withdraw(first.id, erase=True)
    third = study.enrol(Role.TEST)
    assert third.id == "P003"
    assert third.order == first.order != second.order  # a pseudonym is not, an order is


def test_a_protocol_with_a_byte_order_mark_is_frozen_as_its_bytes_are(study, folder):
    path = folder / "study.toml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    study.enrol(Role.TEST)
    with StudyStore.open(folder / "study.db", read_only=True) as store:
        (version,) = read_protocols(store.connection)
    assert version.sha256 == sha256(path.read_bytes()).hexdigest()
    assert all(one.ok for one in study.verify().findings if one.what == "Protocol")


def test_a_pseudonym_never_looks_like_one_that_is_there(study, folder):
    for name in ("p004", "P\uff10\uff106"):  # as steerlab correct may have been given
        with StudyStore.open(folder / "study.db") as store:
            store.add_participant(name, "training")
        assert study.enrol(Role.TEST).id == f"P{int(name[-1]) + 1:03d}"


ENROLLER = """
import sys
from pathlib import Path
from steerlab.study.contract import Role
from steerlab.study.study import Study

with Study.open(Path(sys.argv[1])) as study:
    print("ready", flush=True)
    sys.stdin.readline()
    for _ in range(6):
        view = study.enrol(Role.TEST)
        print(view.id, *view.order, flush=True)
"""


@pytest.mark.slow
def test_programs_that_enrol_at_once_share_the_blocks(folder):
    programs = [
        subprocess.Popen(
            [sys.executable, "-c", ENROLLER, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for program in programs:
        assert program.stdout.readline() == "ready\n"
    for program in programs:
        program.stdin.write("go\n")
        program.stdin.flush()
    said = [line.split() for program in programs for line in program.communicate()[0].splitlines()]
    assert all(program.returncode == 0 for program in programs)
    assert sorted(words[0] for words in said) == [f"P{n:03d}" for n in range(1, 13)]
    assert set(Counter(tuple(words[1:]) for words in said).values()) == {2}
    with Study.open(folder, read_only=True) as study:
        assert next(one for one in study.verify().findings if one.what == "Condition orders").ok


def test_a_protocol_changed_after_freezing_is_refused_with_both_hashes(study, folder, change):
    change(folder, ("seed = 2021", "seed = 2022"))  # nobody is enrolled: simply a change
    who = study.enrol(Role.TEST).id
    frozen = study.verify().findings
    assert all(one.ok for one in frozen if one.what == "Protocol")
    change(folder, ("seed = 2022", "seed = 2023"))
    for act in (
        lambda: study.enrol(Role.TEST),
        lambda: study.run(who, RunConfig(device="scripted:human:1")),
    ):
        with pytest.raises(StudyError) as refused:
            act()
        said = str(refused.value)
        assert said.count("sha256 is") == 1
        assert len({word.strip(",.") for word in said.split() if len(word.strip(",.")) == 64}) == 2
        assert "The first difference is line 9: it was 'seed = 2022" in said
        assert "it is 'seed = 2023" in said
        assert "study amend" in said
    assert [one.id for one in study.participants()] == [who]
    assert not all(one.ok for one in study.verify().findings if one.what == "Protocol")


def test_an_amendment_is_a_new_version_for_those_who_come_after(study, folder, change):
    with pytest.raises(StudyError, match="not frozen yet"):
        study.amend("why not")
    before = study.enrol(Role.TEST)
    with pytest.raises(StudyError, match="as version 1 has it"):
        study.amend("nothing")
    change(folder, ('title = "Practice drive"', 'title = "Warming up"'))
    with pytest.raises(StudyError, match="needs its reason"):
        study.amend("  ")
    assert study.amend("a better title") == 2
    after = study.enrol(Role.TEST)
    titles = [
        [phase.title for phase, _ in study.participant(one.id).phases if phase.id == "practice"]
        for one in (before, after)
    ]
    assert titles == [["Practice drive"], ["Warming up"]]
    assert (before.protocol_version, after.protocol_version) == (1, 2)
    assert before.order != after.order  # the same block goes on
    assert all(one.ok for one in study.verify().findings if one.what == "Protocol")


def test_an_amendment_must_be_right(study, folder, change):
    study.enrol(Role.TEST)
    change(folder, ('key = "bc"', 'key = "bcd"'))
    with pytest.raises(InvalidValue, match=r"line \d+: \$\.conditions\[1\]\.key is 'bcd'"):
        study.amend("a new condition")
    change(folder, ('key = "bcd"', 'key = "bc"'))
    assert study.enrol(Role.TEST).protocol_version == 1


def test_a_wrong_protocol_enrols_nobody(study, folder, change):
    change(folder, ('kind = "calibration"', 'kind = "calibrations"'))
    with pytest.raises(InvalidValue, match=r"\$\.phases\[5\]\.kind is 'calibrations'"):
        study.enrol(Role.TRAINING)
    assert study.change_count() == 0


def test_a_database_from_a_newer_version_is_refused(folder):
    other = connect(folder / "study.db", read_only=False)
    other.execute("UPDATE meta SET value = ? WHERE key = 'schema_version'", (STORE_VERSION + 1,))
    other.close()
    with pytest.raises(StoreError, match="made by another version of steerlab"):
        Study.open(folder)


# Condition orders: balanced in every block, the same for the same seed, different for others.

KEYS = ("mind_meld", "bc", "dagger")


@given(seed=st.integers(0, 2**40), copies=st.integers(1, 3), block=st.integers(0, 50))
@settings(max_examples=60, deadline=None)
def test_every_block_holds_every_order_equally_often(seed, copies, block):
    size = 6 * copies
    drawn = [
        order_at(KEYS, seed=seed, block_size=size, index=block * size + place)
        for place in range(size)
    ]
    assert Counter(drawn) == dict.fromkeys(permutations(KEYS), copies)


@given(seed=st.integers(0, 2**40), index=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_an_order_is_a_matter_of_seed_and_place_alone(seed, index):
    first = order_at(KEYS, seed=seed, block_size=6, index=index)
    assert first == order_at(list(KEYS), seed=seed, block_size=6, index=index)
    assert sorted(first) == sorted(KEYS)


def test_orders_stay_what_they_were():
    """A later version of the program must give what an earlier one assigned."""
    drawn = [order_at(("a", "b", "c"), seed=1, block_size=6, index=i) for i in range(7)]
    assert ["".join(one) for one in drawn] == ["cab", "bca", "cba", "bac", "abc", "acb", "acb"]


@pytest.mark.parametrize(("keys", "orders"), [(("a",), 1), (("a", "b"), 2), ("abcd", 24)])
def test_other_numbers_of_conditions(keys, orders):
    drawn = {order_at(keys, seed=3, block_size=orders, index=i) for i in range(orders)}
    assert len(drawn) == orders


def test_first_places_are_balanced_over_seeds():
    """No order is favoured at the start of a block."""
    first = Counter(order_at(KEYS, seed=s, block_size=6, index=0) for s in range(1200))
    assert len(first) == 6
    assert all(140 < count < 260 for count in first.values())  # 200 expected, sd 13


def test_no_test_participant_comes_before_a_network_can_be_trained(folder, change, run_scripted):
    change(folder, ("network_first = false ", "network_first = true "))
    with Study.open(folder) as study:
        run_scripted(study, Role.TRAINING, 1)
        with pytest.raises(StudyError, match=r"2 training .* must have finished .*, and 1 have"):
            study.enrol(Role.TEST)
        assert [one.id for one in study.participants()] == ["T001"]
        run_scripted(study, Role.TRAINING, 2)
        assert study.enrol(Role.TEST).id == "P001"


def test_a_refused_first_enrolment_freezes_nothing(folder, change):
    change(folder, ("network_first = false ", "network_first = true "))
    with Study.open(folder) as study, pytest.raises(StudyError, match="network_first = false"):
        study.enrol(Role.TEST)
    with Study.open(folder) as study:
        assert study.change_count() == 0


def test_the_order_of_who_leaves_goes_to_the_next(study):
    people = [study.enrol(Role.TEST) for _ in range(6)]
    study.withdraw(people[1].id, erase=False)
    study.withdraw(people[3].id, erase=True)
    study.consent(people[4].id, given=False)
    after = [study.enrol(Role.TEST) for _ in range(4)]
    freed = [people[1], people[3], people[4]]
    assert [one.order for one in after[:3]] == [one.order for one in freed]
    staying = [people[0], people[2], people[5], *after]
    assert len({one.order for one in staying[:6]}) == 6  # the block is whole again
    assert next(c for c in study.verify().findings if c.what == "Condition orders").ok


def test_two_who_share_a_place_in_the_blocks_are_found(study, folder):
    first, second = study.enrol(Role.TEST), study.enrol(Role.TEST)
    study.close()
    with closing(sqlite3.connect(folder / "study.db")) as database:
        for (name,) in database.execute(
            "SELECT name FROM sqlite_master WHERE type = 'trigger'"
        ).fetchall():
            database.execute(f"DROP TRIGGER {name}")
        database.execute("UPDATE enrolments SET place = 0 WHERE participant = ?", (second.id,))
        database.commit()
    with Study.open(folder, read_only=True) as opened:
        check = next(c for c in opened.verify().findings if c.what == "Condition orders")
    assert not check.ok
    assert f"{first.id} and {second.id} share a place" in check.found
