"""Erasure cannot be undone by what was read before it, and finds what lies under other names."""

import shutil

import pytest

from steerlab.app import analyze as analysis
from steerlab.app.analyze import AnalyzeConfig, analyze
from steerlab.learning.splits import StudySplit
from steerlab.learning.tensor_file import write_tensors
from steerlab.study import withdrawal
from steerlab.study.derived import ErasedMeanwhile, ErasureGuard, left_of
from steerlab.study.recording import rebuild
from steerlab.study.recording.rebuild import rebuild_recording
from steerlab.study.study import Study


def _silent(what: str, share: float) -> None:
    pass


def _erase(folder, who="T001"):
    with Study.open(folder) as study:
        study.withdraw(who, erase=True)


def _verified(folder):
    with Study.open(folder, read_only=True) as study:
        return study.verify()


def _analyze(folder, out, networks=0):
    return analyze(
        folder, AnalyzeConfig(networks=networks), out, force=True, command="x", progress=_silent
    )


def test_an_analysis_that_was_reading_while_somebody_was_erased_keeps_nothing(trained, monkeypatch):
    real = analysis.analyse

    def meanwhile(*args, **kwargs):
        _erase(trained)
        return real(*args, **kwargs)

    monkeypatch.setattr(analysis, "analyse", meanwhile)
    with pytest.raises(ErasedMeanwhile, match="T001 were erased while this ran"):
        _analyze(trained, trained)
    assert not (trained / "report").exists()
    assert not left_of(trained, "T001")
    assert _verified(trained).ok
    monkeypatch.undo()
    _analyze(trained, trained)  # the same command again
    assert (trained / "report" / "index.html").exists()
    assert not left_of(trained, "T001")


def test_a_network_that_was_in_training_meanwhile_is_not_kept(trained, monkeypatch):
    from steerlab.analysis.study_data import networks

    def meanwhile(series, *_):
        _erase(trained)
        seen = tuple(series)
        return StudySplit(train_seen=seen, held_out_seen=(), calibrate_new=(), held_out_new=())

    monkeypatch.setattr(networks, "_untrainable", lambda *_: None)  # two people are too few
    monkeypatch.setattr(networks, "split_rollouts", lambda names: names)
    monkeypatch.setattr(networks, "split_study", meanwhile)
    with pytest.raises(ErasedMeanwhile):
        _analyze(trained, trained, networks=1)
    assert not list((trained / "models").glob("analysis-*"))
    assert _verified(trained).ok


def test_a_recording_that_was_being_rebuilt_meanwhile_is_not_kept(trained, monkeypatch):
    real, out = rebuild.write_recording, trained / "recordings" / "T001.rrd"

    def meanwhile(data, *args, **kwargs):
        real(data, *args, **kwargs)
        if data.attempt.participant == "T001":
            monkeypatch.undo()
            _erase(trained)

    monkeypatch.setattr(rebuild, "write_recording", meanwhile)
    with pytest.raises(ErasedMeanwhile):
        rebuild_recording(trained, out, participant="T001")
    assert not out.exists()
    assert _verified(trained).ok


def test_what_was_put_in_place_before_goes_with_the_erasure(trained):
    _analyze(trained, trained / "a first look")
    shutil.copytree(trained / "a first look" / "report", trained / "kept" / "deep" / "report")
    rebuild_recording(trained, trained / "talk.rrd", participant="T001")
    write_tensors({}, {"people": ["T001"]}, trained / "NETWORK.SAFETENSORS")
    assert left_of(trained, "T001")
    (trained / "notes.txt").write_text("T001 was late")  # nobody's but the experimenter's
    _erase(trained)
    assert not left_of(trained, "T001")
    assert not (trained / "a first look" / "report").exists()
    assert not (trained / "kept" / "deep" / "report").exists()
    assert not (trained / "talk.rrd").exists()
    assert not (trained / "NETWORK.SAFETENSORS").exists()
    assert (trained / "notes.txt").exists()
    assert _verified(trained).ok


def test_verify_finds_what_came_back_after_an_erasure(trained, tmp_path):
    _analyze(trained, tmp_path)
    _erase(trained)
    assert _verified(trained).ok
    shutil.copytree(tmp_path / "report", trained / "from the backup")
    verified = _verified(trained)
    assert not verified.ok
    assert any("erasure of T001 is not finished" in check.found for check in verified.findings)
    _erase(trained)
    assert not left_of(trained, "T001")  # as the remedy says
    assert _verified(trained).ok


def test_an_erasure_waits_for_what_is_being_put_in_place(trained, monkeypatch):
    order = []
    real = withdrawal.derived_files
    guard = ErasureGuard.of(trained)
    monkeypatch.setattr(
        withdrawal, "derived_files", lambda *args: order.append("removed") or real(*args)
    )
    with guard.placing():
        order.append("placed")
    _erase(trained)
    assert order == ["placed", "removed"]
    with pytest.raises(ErasedMeanwhile), guard.placing():
        pass


def test_an_erasure_removes_what_others_are_writing_and_they_say_why(trained, monkeypatch):
    """Not that there is no such file, nor that it cannot be deleted."""
    rooms = []

    class Written(dict):
        def items(self):
            rooms.extend(trained.glob(".report-*.part"))
            _erase(trained)
            return super().items()

    files = analysis.csv_files
    monkeypatch.setattr(analysis, "csv_files", lambda tables: Written(files(tables)))
    with pytest.raises(ErasedMeanwhile, match="Give the same command again"):
        _analyze(trained, trained)
    assert rooms
    assert not any(room.exists() for room in rooms)
    assert _verified(trained).ok


def test_what_its_maker_removes_meanwhile_is_not_left(trained, monkeypatch):
    from steerlab.study import derived

    _erase(trained)
    room = trained / ".all-x.part"
    room.mkdir()
    (room / "0.rrd").write_bytes(b"RRF2 of T001")
    assert left_of(trained, "T001") == [room / "0.rrd"]
    real = derived._holds

    def meanwhile(path, *more):
        path.unlink()
        return real(path, *more)

    monkeypatch.setattr(derived, "_holds", meanwhile)
    assert left_of(trained, "T001") == []
