"""What recording costs the loop, and how large recordings are. ``python -m benchmarks.recording``.

For the cost of a step they come at ten times the control rate, so that the writer thread is busy
at most of them; for the lateness of the loop at the control rate itself.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, perf_counter_ns, sleep

import numpy as np

from benchmarks.rows import Row, at_most, print_rows
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.records import LabelledStep, labelled_step
from steerlab.sim.rollout import Rollout
from steerlab.sim.world import WorldSpec
from steerlab.study.recording.rebuild import rebuild_recording
from steerlab.study.recording.replay import view_of
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.study.recording.video import VIDEO_PX, make_video
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.timing import StepTiming

STEPS = 1200  # a minute at 20 Hz
BUSY_HZ, CONTROL_HZ = 200.0, 20.0
PACED_STEPS = 300

ENQUEUE_P99_LIMIT_US = 50.0
STEP_LIMIT_US = 100.0
WAKE_P99_LIMIT_MS = 2.0  # the gate of an attempt
SIZE_LIMIT_MB = 15.0
REBUILD_LIMIT_S = 2.0
FILM_LIMIT_S = 1.0  # an attempt of 20 s in 20 s


@dataclass(frozen=True)
class _Drive:
    name: str
    world: WorldSpec
    control_hz: float
    rollout: Rollout | None = None


def _steps(rollout: Rollout, name: str) -> list[LabelledStep]:
    """A minute of it, again and again."""
    return [
        replace(
            labelled_step(rollout, k % rollout.steps, 0.3, participant="P01"),
            rollout=name,
            step=k,
            t_s=k / rollout.control_hz,
        )
        for k in range(STEPS)
    ]


def _record(folder: Path, *, rate_hz: float, count: int) -> tuple[list[float], list[float]]:
    """Record steps; each one's time in the loop thread in µs, and how late it woke in ms."""
    rollout = load_calibration_set()[0]
    drive = _Drive("minute", rollout.world, rollout.control_hz)  # of a length not known before
    steps = _steps(rollout, drive.name)[:count]
    device = DeviceInfo(kind=InputKind.SCRIPTED, name="benchmark")
    info = SessionInfo(participant="P01", role="seen", device=device, control_hz=20.0)
    period_ns = round(1e9 / rate_hz)
    handed_us, late_ms = [], []
    with SessionRecorder(folder, info) as recorder:
        sink = recorder.begin(drive)  # pyright: ignore[reportArgumentType]: only what it needs
        start_ns = perf_counter_ns() + period_ns
        for step in steps:
            due_ns = start_ns + step.step * period_ns
            while (left_ns := due_ns - perf_counter_ns()) > 0:
                sleep(left_ns / 1e9)
            woke_ns = perf_counter_ns()
            timing = StepTiming(
                deadline_ns=due_ns,
                actual_ns=woke_ns,
                sample_ns=woke_ns,
                event_age_ns=1_000_000,
                overrun=False,
                focus=True,
                device_ok=True,
            )
            began_ns = perf_counter_ns()
            sink.step(step, timing)
            handed_us.append((perf_counter_ns() - began_ns) / 1e3)
            late_ms.append((woke_ns - due_ns) / 1e6)
        sink.finish()
    return handed_us, late_ms


def run() -> list[Row]:
    """One row a figure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        handed_us, _ = _record(folder / "study", rate_hz=BUSY_HZ, count=STEPS)
        _, late_ms = _record(folder / "paced", rate_hz=CONTROL_HZ, count=PACED_STEPS)
        (live,) = (folder / "study" / "recordings").iterdir()
        began = perf_counter()
        rebuild_recording(folder / "study", folder / "bare.rrd")
        rebuild_s = perf_counter() - began
        rebuild_recording(folder / "study", folder / "pictures.rrd", open_view=view_of)
        began = perf_counter()
        make_video(
            folder / "study",
            folder / "film.mp4",
            open_view=lambda world: view_of(world, VIDEO_PX),
        )
        film_s = (perf_counter() - began) * CONTROL_HZ / STEPS
        sizes_mb = [
            file.stat().st_size / 1e6
            for file in (live, folder / "bare.rrd", folder / "pictures.rrd")
        ]
    live_mb, bare_mb, pictures_mb = sizes_mb
    return [
        at_most("enqueue, p50", float(np.median(handed_us)), ENQUEUE_P99_LIMIT_US, "µs"),
        at_most("enqueue, p99", float(np.quantile(handed_us, 0.99)), ENQUEUE_P99_LIMIT_US, "µs"),
        at_most("step on the loop thread, mean", float(np.mean(handed_us)), STEP_LIMIT_US, "µs"),
        at_most(
            "wake-up at 20 Hz beside it, p99",
            float(np.quantile(late_ms, 0.99)),
            WAKE_P99_LIMIT_MS,
            "ms",
        ),
        at_most("recording, live, a minute", live_mb, SIZE_LIMIT_MB, "MB"),
        at_most("recording, rebuilt, a minute", bare_mb, SIZE_LIMIT_MB, "MB"),
        at_most("recording with pictures, a minute", pictures_mb, SIZE_LIMIT_MB, "MB"),
        at_most("video, a second of it", film_s, FILM_LIMIT_S, "s"),
        at_most("rebuild a minute", rebuild_s, REBUILD_LIMIT_S, "s"),
    ]


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
