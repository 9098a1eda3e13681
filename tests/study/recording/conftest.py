"""A short drive, times for its steps, and a recorder with its study folder."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.records import labelled_step
from steerlab.sim.rollout import Rollout
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.study.recording.viewer import VULKAN_HINT
from steerlab.study.recording.writer import AttemptWriter
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.timing import StepTiming

COLUMNS = (
    "t_s",
    "pose",
    "velocity",
    "acceleration",
    "robot_wheel",
    "oracle_label",
    "oracle_valid",
    "physics_state",
)
ICD_FOLDERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")
DEVICE = DeviceInfo(kind=InputKind.WHEEL, name="G29", guid="03", details={"rate": "1 kHz"})


def short(rollout: Rollout, steps: int) -> Rollout:
    return replace(rollout, **{name: getattr(rollout, name)[:steps] for name in COLUMNS})


def _timing_of(step: int) -> StepTiming:
    due_ns = 10**9 + step * 50_000_000
    return StepTiming(
        deadline_ns=due_ns,
        actual_ns=due_ns + 40_000 + step,
        sample_ns=due_ns + 60_000,
        event_age_ns=None if step == 0 else 3_000_000 + step,
        overrun=step == 2,
        focus=True,
        device_ok=step != 1,
    )


def _drive_steps(
    sink: AttemptWriter, drive: Replay, first: int = 0, last: int | None = None
) -> None:
    rollout = drive.rollout
    assert rollout is not None
    for step in range(first, rollout.steps if last is None else last):
        label = None if step == 1 else 0.1 * step
        sink.step(
            labelled_step(rollout, step, label, participant="P01", attempt=sink.attempt),
            _timing_of(step),
        )


@pytest.fixture(scope="session")
def rollout() -> Rollout:
    return short(load_calibration_set()[0], 12)


@pytest.fixture
def drive(rollout: Rollout) -> Replay:
    return Replay(rollout)


@pytest.fixture
def info() -> SessionInfo:
    return SessionInfo(
        participant="P01",
        role="seen",
        device=DEVICE,
        control_hz=20.0,
        display_hz=60.0,
        screen_px=(960, 540),
        settings={"show_agent_wheel": "no"},
    )


@pytest.fixture
def record(tmp_path: Path, info: SessionInfo) -> Callable[..., SessionRecorder]:
    """Opens a recorder in this test's study folder; without Rerun unless asked for."""

    def open_recorder(**options: object) -> SessionRecorder:
        return SessionRecorder(tmp_path / "study", info, **{"rerun": False, **options})

    return open_recorder


@pytest.fixture
def timing_of() -> Callable[[int], StepTiming]:
    return _timing_of


@pytest.fixture
def drive_steps() -> Callable[..., None]:
    """Hand a drive's steps to a sink, from the first to before the last."""
    return _drive_steps


@pytest.fixture(scope="session")
def vulkan() -> None:
    """The viewer draws with Vulkan, by a software driver if need be."""
    if not any(Path(folder).glob("*.json") for folder in ICD_FOLDERS):
        pytest.skip(f"the Rerun viewer has no Vulkan driver here: {VULKAN_HINT}")
