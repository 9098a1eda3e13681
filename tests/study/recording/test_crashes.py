"""kill -9 at random moments and a full disk: no committed step is lost, the study goes on."""

import os
import signal
import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import suppress
from pathlib import Path
from shutil import disk_usage
from time import sleep

import numpy as np
import pytest

from steerlab.study.recording.session_recorder import SessionRecorder
from steerlab.study.recording.writer import RecordingError
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore

WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from time import sleep
from types import SimpleNamespace
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.records import labelled_step
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.study.recording.writer import AttemptWriter
from steerlab.teleop.timing import StepTiming

rollout = load_calibration_set()[0]
drive = SimpleNamespace(
    name="live", world=rollout.world, control_hz=rollout.control_hz, rollout=None
)
kept = AttemptWriter._keep_step

def keep_and_tell(self, step, timing):
    kept(self, step, timing)
    self.check()
    print("step", step.attempt, step.step, flush=True)

AttemptWriter._keep_step = keep_and_tell
device = DeviceInfo(kind=InputKind.SCRIPTED, name="script")
info = SessionInfo(participant="P01", role="seen", device=device, control_hz=20.0)
with SessionRecorder(Path(sys.argv[1]), info, rerun=sys.argv[2] == "rerun") as recorder:
    print("resumed", len(recorder.resumed), flush=True)
    while True:
        sink = recorder.begin(drive)
        for k in range(40):
            times = StepTiming(deadline_ns=k, actual_ns=k, sample_ns=k, event_age_ns=None,
                               overrun=False, focus=True, device_ok=True)
            taken = labelled_step(rollout, k, float(k), participant="P01", attempt=sink.attempt)
            sink.step(replace(taken, rollout="live"), times)
            sleep(0.002)  # as in a drive, steps come one by one
        sink.event(39, "the last step")
        sink.finish()
        print("finished", sink.attempt, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kills", "rerun", "seed"), [(16, "no", 0), (16, "no", 1), (4, "rerun", 2)]
)
def test_kill_9_at_random_moments(tmp_path: Path, kills: int, rerun: str, seed: int):
    """One study, killed again and again; each time what was told as kept is there."""
    rng = np.random.default_rng(seed)
    steps: set[tuple[int, int]] = set()
    finished: set[int] = set()
    was_running = 0
    for _ in range(kills):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path), rerun],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert writer.stdout is not None
        told = [writer.stdout.readline() for _ in range(int(rng.integers(1, 160)))]
        sleep(float(rng.uniform(0.0, 0.003)))
        os.kill(writer.pid, signal.SIGKILL)
        told += writer.stdout.readlines()
        writer.stdout.close()
        assert writer.wait() == -signal.SIGKILL
        words = [line.split() for line in told if line.endswith("\n")]
        assert words[0] == ["resumed", str(was_running)]
        steps |= {(int(word[1]), int(word[2])) for word in words if word[0] == "step"}
        finished |= {int(word[1]) for word in words if word[0] == "finished"}

        with StudyStore.open(tmp_path / "study.db", read_only=True) as store:
            attempts = store.attempts()
            kept = store.read_labels([*AttemptStatus])
            timings = store.timings()
            whole = store.read_labels([AttemptStatus.FINISHED])
        at = set(zip(kept["attempt"].to_pylist(), kept["step"].to_pylist(), strict=True))
        assert steps <= at
        assert (
            set(zip(timings["attempt"].to_pylist(), timings["step"].to_pylist(), strict=True)) == at
        )
        status = Counter(a.status for a in attempts)
        was_running = status[AttemptStatus.RUNNING]
        assert was_running <= 1
        assert finished <= {a.attempt for a in attempts if a.status is AttemptStatus.FINISHED}
        assert whole.num_rows == 40 * status[AttemptStatus.FINISHED]
        assert [a.attempt for a in attempts] == list(range(len(attempts)))
    check = sqlite3.connect(tmp_path / "study.db")
    assert check.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    assert check.execute("PRAGMA foreign_key_check").fetchall() == []
    check.close()
    assert {a.end_reason for a in attempts if a.status is AttemptStatus.ABANDONED} == {
        "found running after a crash"
    }


@pytest.fixture
def small_disk(tmp_path: Path):
    """A disk of 2 MB, of which a file takes half."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(place)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount command")
    if done.returncode != 0:
        pytest.skip(f"a small disk cannot be mounted: {done.stderr.strip()}")
    (place / "ballast").write_bytes(bytes(1 << 20))
    yield place
    subprocess.run(["umount", str(place)], check=True)


def fill(file: Path) -> None:
    """Write until nothing fits any more."""
    with file.open("wb", buffering=0) as filler, suppress(OSError):
        while filler.write(bytes(4096)):
            pass
    assert disk_usage(file).free == 0


@pytest.mark.parametrize("rerun", [False, True])
def test_a_full_disk_stops_the_drive_and_harms_nothing(
    small_disk: Path, info, drive, drive_steps, rerun
):
    study = small_disk / "study"
    with SessionRecorder(study, info, rerun=rerun) as recorder:
        drive_steps(done := recorder.begin(drive), drive)
        done.finish()
        sink = recorder.begin(drive)
        drive_steps(sink, drive, last=3)
        recorder._thread.ask(lambda: None)
        fill(small_disk / "filler")

        def drive_on():
            for step in range(3, 12):
                drive_steps(sink, drive, step, step + 1)
                recorder._thread.ask(lambda: None)
            sink.finish()

        with pytest.raises(RecordingError, match=r"full; free some room.*before is safe"):
            drive_on()
        check = sqlite3.connect(study / "study.db")
        assert check.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        check.close()
        with pytest.raises(RecordingError, match="full; free some room"):
            sink.abandon("the disk was full")

        (small_disk / "filler").unlink()
        (small_disk / "ballast").unlink()
        sink.abandon("the disk was full")
        drive_steps(again := recorder.begin(drive), drive)
        again.finish()
    with StudyStore.open(study / "study.db", read_only=True) as store:
        assert [a.status for a in store.attempts()] == [
            AttemptStatus.FINISHED,
            AttemptStatus.ABANDONED,
            AttemptStatus.FINISHED,
        ]
        assert store.read_labels([AttemptStatus.FINISHED]).num_rows == 24
        assert store.steps(store.attempts()[1]).num_rows >= 3
