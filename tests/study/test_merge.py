"""``study merge``: two studies of one protocol become one, whose sources stay verifiable."""

import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from steerlab.app.cli import main
from steerlab.study.backup import backup
from steerlab.study.contract import Role, Standing, StudyError
from steerlab.study.merge import merge
from steerlab.study.store.people import erase_rows, insert_enrolment, read_enrolments
from steerlab.study.store.store import StudyStore
from steerlab.study.study import Study
from tests.study.conftest import edit, make_small
from tests.study.test_backup import FULL, content
from tests.study.test_verify import tamper

PREFIXES = (('training_prefix = "T"', 'training_prefix = "TB"'),)
PREFIXES += (('test_prefix = "P"', 'test_prefix = "PB"'),)


@pytest.fixture(scope="session")
def second_once(tmp_path_factory, trained_once) -> Path:
    """On another computer, with prefixes of its own: who finished, who left, who has only begun."""
    from tests.study.conftest import _run_scripted

    folder = make_small(tmp_path_factory.mktemp("second") / "study")
    edit(folder, *PREFIXES)
    with Study.open(folder) as study:
        for seed in (3, 4):
            _run_scripted(study, Role.TRAINING, seed)
        study.note("TB001", "asked for a break")
        study.note(None, "moved the table")
        study.redo("TB001", "about-you")
        study.new_link("TB002")
        study.enrol(Role.TEST)
        gone = study.enrol(Role.TRAINING).id
        study.consent(gone, given=True)
        study.withdraw(gone, erase=True)
    return folder


@pytest.fixture
def second(second_once, tmp_path) -> Path:
    return Path(shutil.copytree(second_once, tmp_path / "second"))


def verified(folder: Path, **how):
    with Study.open(folder, read_only=True) as study:
        return study.verify(**how)


def bad(folder: Path) -> dict[str, str]:
    found = [(one.what, one.found) for one in verified(folder).findings if not one.ok]
    return {what: "; ".join(said for name, said in found if name == what) for what, _ in found}


def rows(folder: Path, table: str, where: str = "1") -> list[tuple]:
    with StudyStore.open(folder / "study.db", read_only=True) as store:
        found = store.connection.read(f"SELECT * FROM {table} WHERE {where}")
    return sorted(found, key=repr)


def test_all_of_both_is_in_one_study(trained, second, tmp_path):
    heads = verified(trained).head, verified(second).head
    before = content(trained)["study.db"], content(second)["study.db"]
    done = merge(trained, second, tmp_path / "both")
    both = tmp_path / "both"
    assert {path.name for path in both.iterdir()} - {"study.db-head"} == {"study.db", "study.toml"}
    assert done.verified.ok, [one for one in done.verified.findings if not one.ok]
    assert done.participants == (("T001", "T002"), ("PB001", "TB001", "TB002", "TB003"))
    for table in ("steps", "timings", "attempts", "flags", "sessions", "participants"):
        assert rows(both, table) == sorted(rows(trained, table) + rows(second, table), key=repr)
    for table in ("responses", "events", "phase_events", "consents", "links", "notes"):
        apart, merged = rows(trained, table) + rows(second, table), rows(both, table)
        assert Counter(row[1:] for row in merged) == Counter(row[1:] for row in apart)
        assert len({row[0] for row in merged}) == len(merged)
    with Study.open(both) as study:
        standing = {view.id: view.standing for view in study.participants()}
        assert standing["TB002"] is Standing.FINISHED
        assert standing["TB001"] is Standing.RUNNING  # a phase was opened again
        assert standing["TB003"] is Standing.WITHDRAWN_ERASED
        assert study.notes(None)[-1][1] == "moved the table"
        assert study.enrol(Role.TRAINING).id == "T003"
    for head in heads:  # what was written down at either computer
        assert verified(both, expected_head=head).ok
    assert both.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in both.rglob("*") if path.is_file()} == {0o600}
    assert (content(trained)["study.db"], content(second)["study.db"]) == before


def test_work_goes_on_in_the_merged_study(trained, second, tmp_path, run_scripted):
    merge(trained, second, both := tmp_path / "both")
    with Study.open(both) as study:
        study.withdraw("TB002", erase=True)
        model = study.train(lambda what, share: None)
        assert model.people == ("T001", "T002")  # TB001 has a phase to do again
        run_scripted(study, Role.TEST, 9)
        study.withdraw("T001", erase=True)
        study.withdraw("PB001", erase=False)
        found = study.verify()
        wrong = [one.found for one in found.findings if not one.ok]
        assert all("network that was removed" in one for one in wrong)  # too few are left
        for who in ("T001", "TB002"):
            for table in ("steps", "responses", "attempts"):
                query = f"SELECT count(*) FROM {table} WHERE participant = ?"
                assert study._opened.store.connection.read(query, who) == [(0,)]
    backup(both, tmp_path / "copy")
    assert "Merged" in [one.what for one in verified(tmp_path / "copy").findings]


def test_three_computers_are_merged_in_turn(trained, second, tmp_path, run_scripted):
    third = make_small(tmp_path / "third")
    edit(third, ('training_prefix = "T"', 'training_prefix = "TC"'))
    edit(third, ('test_prefix = "P"', 'test_prefix = "PC"'))
    with Study.open(third) as study:
        who, _ = run_scripted(study, Role.TRAINING, 5)
    merge(third, second, tmp_path / "two")
    done = merge(trained, tmp_path / "two", tmp_path / "three")
    assert done.verified.ok
    (merged,) = [one for one in done.verified.findings if one.what == "Merged"]
    assert "2 studies were taken in" in merged.found
    for folder in (trained, second, third):
        assert verified(tmp_path / "three", expected_head=verified(folder).head).ok
    with pytest.raises(StudyError, match="are the same study, or one is a copy"):
        merge(tmp_path / "three", second, tmp_path / "four")
    assert who == "TC001"


def test_orders_are_of_blocks_of_their_own(tmp_path):
    folders = [make_small(tmp_path / name) for name in ("one", "other")]
    edit(folders[1], *PREFIXES)
    for folder, people in zip(folders, (4, 7), strict=True):
        with Study.open(folder) as study:
            for _ in range(people):
                study.enrol(Role.TEST)
    done = merge(*folders, tmp_path / "both")
    assert done.verified.ok
    assert [sum(counts) for counts in zip(*done.orders.values(), strict=True)] == [4, 7]
    assert len(done.orders) == 6
    with Study.open(tmp_path / "both") as study:
        for _ in range(2):
            study.enrol(Role.TEST)
        first = [p for p in read_enrolments(study._opened.store.connection) if p.role == "test"]
        block = [p.condition_order for p in first if p.participant.startswith("P0")]
        assert len(set(block)) == 6  # the first study's block was filled
        assert study.verify().ok


def test_an_edit_of_a_source_s_audit_is_found(trained, second, tmp_path):
    merge(trained, second, both := tmp_path / "both")
    with Study.open(both) as study:
        tamper(study, "UPDATE merged_audits SET detail = 'x' WHERE id = 3")
    assert "entry 3 of the audit of study" in bad(both)["Merged"]
    with Study.open(both) as study:
        tamper(study, "DELETE FROM merged_audits WHERE id > 5")
    assert "has 5 of" in bad(both)["Merged"]
    with Study.open(both) as study:
        tamper(study, "UPDATE merged_audits SET study = 'another'")
    assert "has 0 of" in bad(both)["Merged"]


def test_an_edit_of_what_was_taken_in_is_found(trained, second, tmp_path):
    merge(trained, second, both := tmp_path / "both")
    with Study.open(both) as study:
        tamper(
            study,
            "UPDATE steps SET teacher_label = 0.5 WHERE participant = 'TB001' AND step = 3",
            "DELETE FROM responses WHERE participant = 'TB002'",
        )
    assert "attempt TB001" in bad(both)["Labels"]
    assert "are gone" in bad(both)["Answers"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((), "both have a participant T001 and 1 more; give each computer a training_prefix"),
        ((*PREFIXES, ("seed = ", "seed = 9")), "differ in seed of version 1"),
        ((*PREFIXES, ("balls = 1", "balls = 2")), "differ in practice of version 1"),
        ((*PREFIXES, ("show_agent_wheel = false", "show_agent_wheel = true")), "in display of"),
    ],
)
def test_protocols_may_differ_in_prefixes_alone(trained, tmp_path, change, said):
    other = make_small(tmp_path / "other")
    edit(other, *change)
    with Study.open(other) as study:
        for _ in range(2):
            study.enrol(Role.TRAINING)
    with pytest.raises(StudyError, match=said):
        merge(trained, other, tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_what_cannot_be_one_study_is_refused(trained, second, tmp_path):
    out = tmp_path / "both"
    with pytest.raises(StudyError, match="are the same study"):
        merge(trained, trained, out)
    with pytest.raises(StudyError, match="are the same study"):
        merge(trained, Path(shutil.copytree(trained, tmp_path / "copy")), out)
    with pytest.raises(StudyError, match=r"Nobody is enrolled in .*empty"):
        merge(trained, make_small(tmp_path / "empty"), out)
    with pytest.raises(StudyError, match="choose another folder"):
        merge(trained, second, trained / "both")
    (full := tmp_path / "full").mkdir()
    (full / "letter.txt").write_text("x")
    with pytest.raises(StudyError, match="is not empty; give the merged study a new folder"):
        merge(trained, second, full)
    with Study.open(second) as study:
        edit(second, ("balls = 1", "balls = 3"))
        study.amend("more practice")
    with pytest.raises(StudyError, match=r"has 1 versions of its protocol and .*second 2"):
        merge(trained, second, out)
    assert not out.exists()


def test_names_that_look_alike_are_refused(trained, second, tmp_path):
    with StudyStore.open(second / "study.db") as store:
        person = read_enrolments(store.connection)[0]
        with store.connection.transaction("enrol"):
            insert_enrolment(store.connection, replace(person, participant="t001"))
    with pytest.raises(StudyError, match="'T001' and 't001' differ only by"):
        merge(trained, second, tmp_path / "both")


def test_different_questionnaires_are_refused(trained, tmp_path):
    other = make_small(tmp_path / "other")
    edit(other, *PREFIXES)
    with Study.open(other) as study:
        study.enrol(Role.TRAINING)
        tamper(study, "UPDATE instruments SET sha256 = 'x' WHERE key = 'fluency'")
    with pytest.raises(StudyError, match="different questionnaires under the name 'fluency'"):
        merge(trained, other, tmp_path / "both")


def test_two_networks_are_refused(trained, second, tmp_path):
    for folder in (trained, second):
        with Study.open(folder) as study:
            if folder is second:
                tamper(study, "DELETE FROM phase_events WHERE act = 'reopened'")
            study.train(lambda what, share: None)
    with pytest.raises(StudyError, match="have each a network of their own"):
        merge(trained, second, tmp_path / "both")


def test_one_network_stays(trained, second, tmp_path):
    with Study.open(trained) as study:
        model = study.train(lambda what, share: None)
    done = merge(second, trained, tmp_path / "both")
    assert done.network == trained
    assert done.verified.ok
    with Study.open(tmp_path / "both") as study, pytest.raises(StudyError, match="is frozen since"):
        study.train(lambda what, share: None)
    assert (tmp_path / "both" / model.file).is_file()


def test_an_unfinished_erasure_and_damage_are_refused(trained, second, tmp_path):
    with Study.open(trained) as study:
        tamper(study, "UPDATE responses SET value = '7' WHERE id = 1")
    with pytest.raises(StudyError, match=r"cannot be merged as it is\. Answers: 1 differ"):
        merge(second, trained, tmp_path / "both")
    with StudyStore.open(second / "study.db") as store:
        erase_rows(store.connection, "TB001")
    with pytest.raises(StudyError, match="erasure of TB001 is not finished"):
        merge(trained, second, tmp_path / "both")


@pytest.mark.parametrize("size", [10_000, 300_000])
def test_a_disk_that_takes_no_more_leaves_nothing(trained, second, tmp_path, size):
    pytest.importorskip("resource")
    command = [sys.executable, "-B", "-c", FULL, str(size), "study", "merge"]
    command += [str(trained), str(second), "--out", str(tmp_path / "both")]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 2, done
    assert "ulimit -f" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["second", "trained"]


def test_the_command_says_what_came_of_it(trained, second, tmp_path, capsys):
    out = str(tmp_path / "both")
    assert main(["study", "merge", str(trained), str(second), "--out", out]) == 0
    said = capsys.readouterr().out
    assert f"From {second}: PB001, TB001, TB002, TB003" in said
    assert "  1 = 0 + 1  " in said
    assert f"Head of the audit (keep it elsewhere): {verified(tmp_path / 'both').head}" in said
    assert main(["study", "merge", str(trained), str(trained), "--out", out]) == 2
    assert "is not empty" in capsys.readouterr().err
