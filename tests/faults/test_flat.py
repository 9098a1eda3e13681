"""A day of drives leaves nothing behind in the process that records them."""

import os
from pathlib import Path

import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.loop import NullClock, run_drive
from steerlab.teleop.practice import Unrecorded
from tests.faults.soak import Resources, SteadyWheel

DRIVES, FIRST = 100, 20


@pytest.mark.skipif(
    not Path("/proc/self/task").is_dir(), reason="counts threads as Linux shows them"
)
def test_threads_handles_and_memory_are_flat_over_a_hundred_recorded_drives(tmp_path):
    shortest = min(load_calibration_set(), key=lambda rollout: rollout.steps)
    info = SessionInfo(
        participant="P01",
        role="seen",
        device=DeviceInfo(kind=InputKind.SCRIPTED, name="steady"),
        control_hz=20.0,
    )
    device = SteadyWheel()
    seen: list[Resources] = []
    with SessionRecorder(tmp_path / "study", info) as recorder:
        for number in range(DRIVES):
            drive = Replay(shortest)
            record = recorder.begin(drive)
            run_drive(
                drive,
                device,
                participant="P01",
                order=record.order,
                attempt=record.attempt,
                clock=NullClock(),
                sink=record if number % 10 == 0 else _FewSteps(record),
            )
            record.finish() if number % 10 == 0 else record.abandon("only the start is kept")
            if number in (FIRST, DRIVES - 1):
                seen.append(Resources.now())
    first, last = seen
    assert last.threads <= first.threads
    assert last.handles <= first.handles
    assert last.memory_mb <= first.memory_mb + 60
    assert os.listdir(tmp_path / "study" / "recordings")


class _FewSteps(Unrecorded):
    """Keeps the first twenty steps: enough for a recording, and quick."""

    def __init__(self, record) -> None:
        self._record = record

    def step(self, step, timing) -> None:
        if step.step < 20:
            self._record.step(step, timing)
