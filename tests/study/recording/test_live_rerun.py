"""Rerun beside the database: the same data live and rebuilt, and no harm when it fails."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from steerlab.sim.errors import NoRenderer
from steerlab.study.recording.rebuild import rebuild_recording, recording_file
from steerlab.study.recording.viewer import EXECUTABLE, RecordingUnavailable, ViewerProcess
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore


def contents(file: Path, recording: int = 0) -> dict[tuple[str, str, int | None], object]:
    """Each value by entity, component and step."""
    reader = RrdReader(file)
    found = {}
    for chunk in reader.stream(store=reader.recordings()[recording]):
        batch = chunk.to_record_batch()
        indexes = {*chunk.timeline_names, "rerun.controls.RowId"}
        for row in batch.to_pylist():
            step = row.get("step")
            for name, value in row.items():
                if name not in indexes and value is not None:
                    found[chunk.entity_path, name, step] = repr(value)  # repr: NaN equals NaN
            if step is not None:
                found[chunk.entity_path, "t", step] = row["t"]
    return found


@pytest.fixture
def finished(tmp_path):
    def read():
        with StudyStore.open(tmp_path / "study" / "study.db", read_only=True) as store:
            return [a.status for a in store.attempts()], store.read_labels(
                [AttemptStatus.FINISHED]
            ).num_rows

    return read


def recorded(recorder, drive, drive_steps):
    sink = recorder.begin(drive)
    drive_steps(sink, drive, last=5)
    sink.event(4, "takeover")
    drive_steps(sink, drive, first=5)
    sink.finish()
    recorder._thread.ask(lambda: None)  # until the file is closed
    return recorder.folder / "recordings" / recording_file("P01", drive.name, sink.attempt)


def test_live_and_rebuilt_recordings_hold_the_same(record, drive, drive_steps, tmp_path):
    with record(rerun=True) as recorder:
        file = recorded(recorder, drive, drive_steps)
        assert recorder.warnings == []
    rebuild_recording(tmp_path / "study", tmp_path / "rebuilt.rrd")
    live, rebuilt = contents(file), contents(tmp_path / "rebuilt.rrd")
    assert live == rebuilt
    steps = {step for _, _, step in live if step is not None}
    assert steps == set(range(drive.rollout.steps))
    assert {path for path, _, _ in live} >= {
        "/wheels",
        "/timing",
        "/events",
        "/about",
        "/world/car",
        "/world/car/ways",
        "/world/paths/driven",
        "/world/blocks",
        "/world/ball",
    }


def test_an_abandoned_attempt_has_a_recording_too(record, drive, drive_steps, tmp_path):
    with record(rerun=True) as recorder:
        sink = recorder.begin(drive)
        drive_steps(sink, drive, last=4)
        sink.abandon("the window lost the focus")
        drive_steps(sink := recorder.begin(drive), drive)
        sink.finish()
    names = [recording_file("P01", drive.name, attempt) for attempt in (0, 1)]
    assert sorted(os.listdir(tmp_path / "study" / "recordings")) == names
    first = contents(tmp_path / "study" / "recordings" / names[0])
    assert {step for path, _, step in first if path == "/wheels" and step is not None} == {
        0, 1, 2, 3,
    }  # fmt: skip
    ((_, text),) = [
        (key, value) for key, value in first.items() if key[:2] == ("/about", "TextDocument:text")
    ]
    assert "abandoned: the window lost the focus" in str(text)


def test_a_folder_that_cannot_be_written_is_a_warning(
    record, drive, drive_steps, tmp_path, finished
):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "recordings").write_text("a file where a folder should be")
    with record(rerun=True) as recorder:
        for _ in range(2):
            recorded(recorder, drive, drive_steps)
        unwritten = [text for text in recorder.warnings if "not written" in text]
        assert unwritten
        assert all("The data is safe in study.db" in text for text in recorder.warnings)
    assert finished() == ([AttemptStatus.FINISHED] * 2, 24)
    with StudyStore.open(tmp_path / "study" / "study.db") as store:
        assert [e.detail for e in store.audit() if e.act == "warning"] == recorder.warnings


def test_a_viewer_that_is_not_there_is_a_warning(
    record, drive, drive_steps, monkeypatch, tmp_path, finished
):
    monkeypatch.setenv(EXECUTABLE, str(tmp_path / "no-such-viewer"))
    with record(rerun=True, open_viewer=ViewerProcess) as recorder:
        recorded(recorder, drive, drive_steps)
        (warning,) = recorder.warnings
    assert "There is no live viewer" in warning
    assert "pip install rerun-sdk" in warning
    assert finished() == ([AttemptStatus.FINISHED], 12)


def test_a_viewer_without_a_display_says_what_it_lacks(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(RecordingUnavailable, match=r"did not come up.*DISPLAY.*needs a display"):
        ViewerProcess()


@pytest.mark.render
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_a_viewer_that_is_killed_or_hangs_costs_nothing(
    record, drive, drive_steps, finished, blow, vulkan
):
    viewers = []

    def open_viewer():
        viewers.append(ViewerProcess(headless=True))
        return viewers[0]

    with record(rerun=True, open_viewer=open_viewer) as recorder:
        file = recorded(recorder, drive, drive_steps)
        assert recorder.warnings == []
        sink = recorder.begin(drive)
        drive_steps(sink, drive, last=5)
        os.kill(viewers[0]._process.pid, blow)
        if blow is signal.SIGKILL:
            viewers[0].wait()
        drive_steps(sink, drive, first=5)
        sink.finish()
        recorded(recorder, drive, drive_steps)
        (warning,) = recorder.warnings
        assert ("was closed" if blow is signal.SIGKILL else "hung") in warning
        assert not viewers[0].alive
    assert finished() == ([AttemptStatus.FINISHED] * 3, 36)
    for attempt in range(3):
        here = contents(file.with_name(recording_file("P01", drive.name, attempt)))
        assert {step for _, _, step in here if step is not None} == set(range(12))


KILLED = """
import os, signal, sys, time
from pathlib import Path
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.records import labelled_step
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.drives.replay import Replay
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder

drive = Replay(load_calibration_set()[0])
device = DeviceInfo(kind=InputKind.SCRIPTED, name="script")
info = SessionInfo(participant="P01", role="seen", device=device, control_hz=20.0)
recorder = SessionRecorder(Path(sys.argv[1]), info)
sink = recorder.begin(drive)
for step in range(60):
    sink.step(labelled_step(drive.rollout, step, 0.1, participant="P01"), None)
recorder._thread.ask(lambda: None)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_program_leaves_no_half_recording_and_all_can_be_made_again(tmp_path):
    folder = tmp_path / "study"
    done = subprocess.run([sys.executable, "-c", KILLED, str(folder)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert list((folder / "recordings").iterdir()) == []
    rebuild_recording(folder, tmp_path / "rebuilt.rrd")
    rebuilt = contents(tmp_path / "rebuilt.rrd")
    assert {step for _, _, step in rebuilt if step is not None} == set(range(60))


def test_no_two_attempts_share_a_file():
    files = [
        recording_file(*key)
        for key in (("a", "b-c", 0), ("a-b", "c", 0), ("a/b", "c", 0), ("a%2Fb", "c", 0))
    ]
    assert len(set(files)) == len(files)
    assert all("/" not in file for file in files)


class Grey:
    def __init__(self, world):
        self.world = world

    def __enter__(self):
        return self

    def __exit__(self, *why):
        pass

    def frame(self, pose, road_wheel_rad=0.0):
        return np.full((27, 48, 3), 128, np.uint8)


def test_pictures_are_added_after_the_drive(record, drive, drive_steps):
    with record(rerun=True) as recorder:
        file = recorded(recorder, drive, drive_steps)
        before = contents(file)
        told = []
        recorder.add_pictures(Grey, progress=lambda what, share: told.append(share))
        after = contents(file)
        file.unlink()
        recorder.add_pictures(Grey)  # each attempt once
        assert not file.exists()
        assert recorder.warnings == []
    added = {path for path, _, _ in after.keys() - before.keys()}
    assert before.items() <= after.items()
    assert added == {"/camera"}
    assert told == [0.0, 1.0]


def test_pictures_that_cannot_be_drawn_are_a_warning(record, drive, drive_steps, finished):
    def cannot(world):
        raise NoRenderer("Cannot draw offscreen.")

    with record(rerun=True) as recorder:
        file = recorded(recorder, drive, drive_steps)
        before = contents(file)
        recorder.add_pictures(cannot)
        assert recorder.warnings == [f"{file.name} has no pictures: Cannot draw offscreen."]
        assert contents(file) == before
    assert finished() == ([AttemptStatus.FINISHED], 12)
