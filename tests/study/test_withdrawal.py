"""Leaving: data kept, or erased without a trace in database, log, recordings and models."""

import struct
from pathlib import Path

import numpy as np
import pytest

from steerlab.learning.checkpoint import load_mapper
from steerlab.sim.files.folder_lock import RUN_LOCK, LockedOut, locked
from steerlab.study import withdrawal
from steerlab.study.contract import Role, Standing, StudyError
from steerlab.study.models import frozen_model
from steerlab.study.store.errors import StoreError
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.store.people import scrub
from steerlab.study.study import Study

SECRET = "Quokka-of-Rottnest"


def everything(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def traces(folder: Path, marks: list[bytes]) -> list[tuple[str, int]]:
    return [
        (name, number)
        for name, raw in everything(folder).items()
        for number, mark in enumerate(marks)
        if mark in raw
    ]


def labels_of(study: Study, who: str) -> np.ndarray:
    table = study._opened.store.read_labels()
    mine = [row for row in table.to_pylist() if row["participant"] == who]
    return np.array([row["teacher_label"] for row in mine])


@pytest.fixture
def full(study, folder, run_scripted):
    """Three training participants and one test participant, with recordings and a secret."""
    for seed in (1, 2, 3):
        run_scripted(study, Role.TRAINING, seed)
    run_scripted(study, Role.TEST, 4)
    recordings = folder / "recordings"
    recordings.mkdir(exist_ok=True)
    for who in ("T001", "T002", "P001"):
        (recordings / f"{who}-calibration-05-0.rrd").write_bytes(b"drive of " + who.encode())
        study.note(who, f"{SECRET} {who}")
    return study


def test_keeping_keeps_everything(full, folder):
    changing = ("study.db", "run.pid")  # the latter says who ran last
    before = {
        name: raw
        for name, raw in everything(folder).items()
        if not any(one in name for one in changing)
    }
    full.withdraw("T002", erase=False)
    full.withdraw("T002", erase=False)  # again
    view = full.participant("T002")
    assert view.standing is Standing.WITHDRAWN_KEPT
    assert view.next_phase is None
    after = {
        name: raw
        for name, raw in everything(folder).items()
        if not any(one in name for one in changing)
    }
    assert after == before
    assert len(labels_of(full, "T002")) > 0
    with pytest.raises(StudyError, match="has left"):
        full.redo("T002", "about-you")


def test_erasing_leaves_no_trace_but_a_tombstone(full, folder):
    connection = full._opened.store.connection
    labels = labels_of(full, "T001")
    numbers = [struct.pack(">d", value) for value in labels[[7, 40, -1]]]  # as SQLite stores them
    w = load_mapper(folder / frozen_model(full._opened).file).embedding("T001").astype("float32")
    marks = [f"{SECRET} T001".encode(), b"drive of T001", w.tobytes(), *numbers]
    nonces = connection.read("SELECT nonce FROM responses WHERE participant = 'T001' LIMIT 3")
    marks += [nonce.encode() for (nonce,) in nonces]
    assert {number for _, number in traces(folder, marks)} == set(range(len(marks)))
    old = frozen_model(full._opened)

    full.withdraw("T001", erase=True)

    assert traces(folder, marks) == []
    assert full.participant("T001").standing is Standing.WITHDRAWN_ERASED
    assert [view.id for view in full.participants()] == ["T001", "T002", "T003", "P001"]
    for table in ("responses", "notes", "consents", "sessions", "attempts", "steps"):
        query = f"SELECT count(*) FROM {table} WHERE participant = 'T001'"
        assert connection.read(query) == [(0,)], table
    others = b"".join(everything(folder).values())
    assert f"{SECRET} T002".encode() in others
    new = frozen_model(full._opened)
    assert new.sha256 != old.sha256
    assert new.people == ("T002", "T003")
    assert not (folder / old.file).exists()
    assert load_mapper(folder / new.file).people == ("T002", "T003")
    assert read_embeddings(connection)["P001"].model_sha256 == new.sha256
    verified = full.verify()
    assert verified.ok, [one for one in verified.findings if not one.ok]
    withdrawn = [e.detail for e in full._opened.store.audit() if e.act == "withdrawn"]
    assert withdrawn == ["T001: erasing", "T001: erased"]
    count = full.change_count()
    full.withdraw("T001", erase=True)  # again
    assert full.change_count() == count
    with pytest.raises(StudyError, match="erased; they cannot be kept"):
        full.withdraw("T001", erase=False)
    with pytest.raises(StudyError, match="nothing about them is kept"):
        full.note("T001", "x")


def test_without_enough_people_the_network_is_removed(full, folder, run_scripted):
    full.withdraw("T001", erase=True)
    full.withdraw("T002", erase=True)
    assert frozen_model(full._opened) is None
    assert list((folder / "models").iterdir()) == []
    stale = [one for one in full.verify().findings if "network that was removed" in one.found]
    assert "steerlab study train" in stale[0].mend
    run_scripted(full, Role.TRAINING, 7)
    model = full.train(lambda what, share: None)
    assert model.people == ("T003", "T004")
    assert read_embeddings(full._opened.store.connection)["P001"].model_sha256 == model.sha256
    assert full.verify().ok
    with pytest.raises(StudyError, match="is frozen since"):
        full.train(lambda what, share: None)


def test_erasing_a_test_participant_leaves_the_network(full, folder):
    before = frozen_model(full._opened)
    full.withdraw("P001", erase=True)
    assert frozen_model(full._opened) == before
    assert [path.name for path in (folder / "models").iterdir()] == [Path(before.file).name]
    assert read_embeddings(full._opened.store.connection) == {}


def test_a_file_that_training_left_when_it_was_cut_off_goes_too(full, folder):
    (orphan := folder / "models" / "mind_meld-000000000000.safetensors").write_bytes(b"whose?")
    (part := folder / "models" / ".training.part").write_bytes(b"whose?")
    full.withdraw("P001", erase=True)
    assert not orphan.exists()
    assert not part.exists()
    assert full.verify().ok


def test_an_erasure_waits_for_nobody_who_calibrates_again(full, folder):
    full.redo("P001", "calibration")  # has no finished attempt that counts now
    full.withdraw("T001", erase=True)
    assert full.participant("T001").standing is Standing.WITHDRAWN_ERASED
    assert full.verify().ok  # no complaint about a w that is to be found anew


def test_exports_and_reports_go_with_the_person(full, folder):
    for name in ("exports", "report", ".report-abc123.part"):  # the last was cut off
        (folder / name / "tables").mkdir(parents=True)
        (folder / name / "tables" / "labels.csv").write_text("T001,0.5\nT002,0.1\n")
    full.withdraw("T002", erase=False)
    assert (folder / "exports" / "tables").is_dir()
    full.withdraw("T001", erase=True)
    assert not (folder / "exports").exists()
    assert not (folder / "report").exists()
    assert not (folder / ".report-abc123.part").exists()


def test_files_that_carry_the_pseudonym_go_and_no_others(full, folder):
    mine = folder / "models" / "taught" / "P001" / "policy-1.safetensors"
    others = [
        folder / "models" / "taught" / "P0011" / "policy-1.safetensors",
        folder / "recordings" / "P0011-calibration-05-0.rrd",
        folder / "P001 - signed consent.pdf",
    ]
    for path in (mine, *others):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    full.withdraw("P001", erase=True)
    assert not mine.parent.exists()
    assert all(path.exists() for path in others)


def test_an_export_that_is_a_link_is_told_and_not_followed(full, folder, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "labels.csv").write_text("T001")
    (folder / "exports").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(StudyError, match=r"is a link to .*elsewhere"):
        full.withdraw("T001", erase=True)
    assert not full.verify().ok
    (folder / "exports").unlink()
    full.withdraw("T001", erase=True)
    assert full.verify().ok
    assert (tmp_path / "elsewhere" / "labels.csv").exists()


def test_who_kept_their_data_may_erase_them_later(full):
    full.withdraw("T002", erase=False)
    full.withdraw("T002", erase=True)
    assert full.participant("T002").standing is Standing.WITHDRAWN_ERASED
    assert len(labels_of(full, "T002")) == 0


@pytest.mark.parametrize("cut_off", ["remove_models_of", "scrub", "renew"])
def test_an_erasure_that_was_cut_off_is_told_and_finished_by_saying_it_again(
    full, folder, monkeypatch, cut_off
):
    def crash(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(withdrawal, cut_off, crash)
        with pytest.raises(KeyboardInterrupt):
            full.withdraw("T001", erase=True)
    assert full.participant("T001").standing is Standing.ERASING
    bad = [one for one in full.verify().findings if not one.ok]
    assert any("erasure of T001 is not finished" in one.found for one in bad)
    full.withdraw("T001", erase=True)
    assert full.verify().ok
    assert traces(folder, [f"{SECRET} T001".encode(), b"drive of T001"]) == []


def test_a_reader_that_holds_the_old_pages_is_told(study, folder, at_about_you, monkeypatch):
    from steerlab.study.store import connection as store_connection
    from steerlab.study.store import people

    monkeypatch.setattr(store_connection, "BUSY_TIMEOUT_S", 0.05)
    monkeypatch.setattr(people, "_LOOKS", 2)
    study.close()
    with Study.open(folder) as study:
        study.note(at_about_you, SECRET)
        reader = store_connection.connect(folder / "study.db", read_only=True)
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM notes").fetchone()
        with pytest.raises(StoreError, match="traces of what was erased remain"):
            study.withdraw(at_about_you, erase=True)
        reader.close()
        study.withdraw(at_about_you, erase=True)
    assert traces(folder, [SECRET.encode()]) == []


def test_nobody_is_withdrawn_while_someone_sits_at_the_wheel(study, folder, at_about_you):
    with locked(folder, RUN_LOCK, "runs"), pytest.raises(LockedOut, match="process"):
        study.withdraw(at_about_you, erase=True)
    assert study.participant(at_about_you).standing is Standing.RUNNING


def test_who_leaves_with_their_data_kept_waits_for_nobody_else_at_the_wheel(
    study, folder, at_about_you
):
    with locked(folder, RUN_LOCK, "runs", about=at_about_you), pytest.raises(LockedOut):
        study.withdraw(at_about_you, erase=False)
    assert study.participant(at_about_you).standing is Standing.RUNNING
    with locked(folder, RUN_LOCK, "runs", about="T099"):
        with pytest.raises(LockedOut):
            study.withdraw(at_about_you, erase=True)
        study.withdraw(at_about_you, erase=False)
    assert study.participant(at_about_you).standing is Standing.WITHDRAWN_KEPT


def test_rows_are_deleted_only_by_erasing(full):
    connection = full._opened.store.connection.sqlite
    import sqlite3

    for table in ("responses", "consents", "notes", "sessions", "embeddings", "enrolments"):
        with pytest.raises(sqlite3.IntegrityError, match="deleted"):
            connection.execute(f"DELETE FROM {table}")
    for table in ("responses", "consents", "notes", "protocols", "enrolments", "embeddings"):
        column = "participant" if table != "protocols" else "text"
        with pytest.raises(sqlite3.IntegrityError, match="never changed"):
            connection.execute(f"UPDATE {table} SET {column} = 'x'")
    scrub(full._opened.store.connection)
    assert full.verify().ok


def test_nobody_is_erased_between_the_check_and_what_is_kept(study, at_about_you, monkeypatch):
    """A note or a link would stay behind them."""
    from steerlab.study import study as module

    real = module.progress_of

    def checked(opened, participant):
        with pytest.raises(StoreError, match="locked"), Study.open(opened.folder) as other:
            other.withdraw(participant, erase=True)
        return real(opened, participant)

    monkeypatch.setattr("steerlab.study.store.connection.BUSY_TIMEOUT_S", 0.05)
    monkeypatch.setattr(module, "progress_of", checked)
    study.note(at_about_you, SECRET)
    study.new_link(at_about_you)
    monkeypatch.undo()
    study.withdraw(at_about_you, erase=True)
    assert study.notes(at_about_you) == []
    with pytest.raises(StudyError, match="nothing about them is kept"):
        study.note(at_about_you, SECRET)
