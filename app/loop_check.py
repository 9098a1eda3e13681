"""``steerlab doctor --loop``: whether this machine keeps time, measured with a virtual wheel."""

import os
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from math import pi, sin
from pathlib import Path
from threading import Event, Thread
from time import perf_counter_ns, sleep
from typing import Any

import numpy as np
import pygame

from steerlab.app.doctor import CheckResult
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.machine import load_average
from steerlab.sim.progress import Progress, ShareProgress
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.teleop.attempt import AttemptRecord, Recorder
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.devices.profile import (
    Measured,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
    this_system,
)
from steerlab.teleop.devices.profile_folder import StoredProfile
from steerlab.teleop.devices.virtual import G920, LOGITECH, VirtualJoystick
from steerlab.teleop.devices.wheel import WheelDevice
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.loop import run_drive
from steerlab.teleop.pacing import NS_PER_S, PacingConfig, WallClock, no_garbage_collection
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.contract import DriveView, Screen
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import NoDisplay, SdlEvents
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import GateConfig, LoopHealth, TimingViolation, failed_gates

TURN_HZ = 0.4  # the wheel goes from side to side this often
MOVES_HZ = 250.0  # and is moved this often, as a wheel reports
AXES = 4
RAW_MAX = 32767  # of SDL's axes
HEARD_WITHIN_MS = 2000  # the virtual wheel's first motion
BUSY = "Close other programs, set the processor to full speed, and try again."
DRAWING = "Use a window (--windowed) or a machine with a graphics driver."
MENDS = {
    "lateness_p99_ms": BUSY,
    "lateness_max_ms": BUSY,
    "overrun_share": BUSY,
    "dropped_share": DRAWING,
    "input_age_p99_ms": BUSY,
}
PARTICIPANT = "doctor"
KEEP_P99_US = 100.0  # handing a step to the recorder may cost the loop this much


@dataclass(frozen=True, kw_only=True)
class LoopCheck:
    """Measurements of the loop.

    Attributes:
        expected_steps: control steps that were due; ``health.steps`` were taken.
        input_p50_ms, input_p99_ms: from the wheel's motion until the loop's sample had it.
        keep_p50_us, keep_p99_us: handing one step to the recorder, on the loop's thread.
        load: the machine's load average over the last minute; None where the system keeps none.
    """

    health: LoopHealth
    expected_steps: int
    input_p50_ms: float
    input_p99_ms: float
    keep_p50_us: float
    keep_p99_us: float
    load: float | None
    failed: tuple[TimingViolation, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)


class MovingWheel:
    """Turns a virtual wheel to and fro on a thread of its own, and notes when it was moved where."""

    def __init__(self, joystick: VirtualJoystick) -> None:
        self._joystick = joystick
        self._stop = Event()
        self._thread = Thread(target=self._turn, name="moving wheel", daemon=True)
        self._moved_ns: dict[int, int] = {}

    def latency_ms(self, wheel: float, sample_ns: int) -> float | None:
        """How long before ``sample_ns`` the wheel was moved to ``wheel``; None if it never was."""
        moved_ns = self._moved_ns.get(_raw(wheel))
        return None if moved_ns is None else (sample_ns - moved_ns) / 1e6

    def __enter__(self) -> "MovingWheel":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _turn(self) -> None:
        start_ns = perf_counter_ns()
        while not self._stop.wait(1.0 / MOVES_HZ):
            now_ns = perf_counter_ns()
            turn = sin(2.0 * pi * TURN_HZ * (now_ns - start_ns) / NS_PER_S)
            value = round(turn * RAW_MAX)
            self._moved_ns[value] = now_ns
            self._joystick.axis(0, value / RAW_MAX)


def check_loop(
    events: SdlEvents,
    *,
    seconds: float,
    screen: Screen | None,
    recorder: Recorder,
    participant: str,
    progress: ShareProgress = lambda share: None,
) -> LoopCheck:
    """Replay the calibration set for some seconds, with all parts of a session but a person.

    Args:
        screen: None measures without a display.
        recorder: records the steps as in a real session.

    Raises:
        SteerlabError: no step was due in that time.
    """
    timings: list[StepTiming] = []
    frame_ns: list[int] = []
    inputs_ms: list[float] = []
    keep_ns: list[int] = []
    dropped = expected = 0
    clock = WallClock(PacingConfig(), events.poll)
    with (
        _stopped_by_quit(events),
        VirtualJoystick(axes=AXES) as joystick,
        MovingWheel(joystick) as mover,
    ):
        device = WheelDevice(events, profiles=[virtual_profile(joystick)])
        device.connect()
        rollouts = load_calibration_set()
        began_ns = perf_counter_ns()
        number = 0
        while (passed_s := (perf_counter_ns() - began_ns) / NS_PER_S) < seconds:
            progress(passed_s / seconds)
            drive = Replay(rollouts[number % len(rollouts)])
            if screen is not None:
                screen.enter(drive.world)
            _until_heard(device, events.poll)
            record = recorder.begin(drive)
            sink = _Measuring(record, mover)
            with no_garbage_collection():
                run_drive(
                    drive,
                    device,
                    participant=participant,
                    order=number,
                    attempt=record.attempt,
                    clock=clock,
                    sink=sink,
                    show=None if screen is None else _drive_drawer(screen, drive, device, clock),
                )
            record.finish(())
            timings += sink.timings
            inputs_ms += sink.inputs_ms
            keep_ns += sink.keep_ns
            frame_ns += clock.frame_ns
            dropped += clock.dropped
            expected += rollouts[number % len(rollouts)].steps
            number += 1
        device.disconnect()
    if not timings:
        raise SteerlabError(f"Nothing can be measured in {seconds:g} s; give a second or more.")
    health = LoopHealth.of(timings, frame_ns, dropped)
    input_p50, input_p99 = np.percentile(inputs_ms, (50, 99))
    keep_p50, keep_p99 = np.percentile(np.array(keep_ns) / 1e3, (50, 99))
    return LoopCheck(
        health=health,
        expected_steps=expected,
        input_p50_ms=float(input_p50),
        input_p99_ms=float(input_p99),
        keep_p50_us=float(keep_p50),
        keep_p99_us=float(keep_p99),
        load=load_average(),
        failed=tuple(failed_gates(health, GateConfig())),
    )


@contextmanager
def _stopped_by_quit(events: SdlEvents) -> Generator[None]:
    """The close button and SIGTERM, of which SDL makes an event, end the block as Ctrl+C does."""

    def listen(event: pygame.event.Event, now_ns: int) -> None:
        if event.type == pygame.QUIT:
            raise KeyboardInterrupt

    stop = events.listen(listen)
    try:
        yield
    finally:
        stop()


class _Measuring:
    """Passes steps on to the recorder, measures how long that takes and how late inputs are."""

    def __init__(self, record: AttemptRecord, mover: MovingWheel) -> None:
        self._record = record
        self._mover = mover
        self.timings: list[StepTiming] = []
        self.inputs_ms: list[float] = []
        self.keep_ns: list[int] = []

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        before_ns = perf_counter_ns()
        self._record.step(step, timing)
        self.keep_ns.append(perf_counter_ns() - before_ns)
        if timing is not None:
            self.timings.append(timing)
            if step.teacher_label is not None:
                late_ms = self._mover.latency_ms(step.teacher_label, timing.sample_ns)
                if late_ms is not None:
                    self.inputs_ms.append(late_ms)


def _raw(wheel: float) -> int:
    return round(wheel / WHEEL_LIMIT * RAW_MAX)


def virtual_profile(joystick: VirtualJoystick) -> StoredProfile:
    """The profile of the virtual wheel, which is exact and needs no calibration."""
    profile = WheelProfile(
        name=joystick.name,
        match=ProfileMatch(vendor=LOGITECH, products=(G920,), axes=AXES, system=this_system()),
        steering=SteeringAxis(axis=0, sign=1),
        measured=Measured(resolution=0.0, rate_hz=MOVES_HZ, noise=0.0, return_error=0.0),
        calibrated=True,
    )
    return StoredProfile(profile=profile, file="virtual", sha256="", shipped=False)


def _until_heard(device: WheelDevice, poll: Callable[[], None]) -> None:
    """Wait for the first sample; the wheel moves all the time, so this takes milliseconds."""
    for _ in range(HEARD_WITHIN_MS):
        poll()
        if device.read().ok:
            return
        sleep(0.001)
    raise SteerlabError(
        "The virtual wheel moves and SDL does not pass it on; is another SDL in use?"
    )


def _drive_drawer(
    screen: Screen, drive: Drive, device: WheelDevice, clock: WallClock
) -> ShareProgress:
    """What draws the drive at a fraction of a control step, 0 to 1."""

    def show(fraction: float) -> None:
        moment, sample = drive.between(fraction), device.read()
        screen.show_drive(
            DriveView(
                pose=moment.pose,
                speed_mps=moment.speed_mps,
                elapsed_s=clock.elapsed_s,
                number=1,
                count=12,
                needle=sample.wheel,
                device=device.info.name,
                device_ok=sample.ok,
                instruction="Measuring how well this computer keeps time.",
            )
        )

    return show


def examine_loop(folder: Path, seconds: float, progress: Progress) -> list[CheckResult]:
    """Run the loop for some seconds; without a display only the control steps are judged.

    Args:
        folder: where studies are kept; a throw-away study is made there, on the same disk.
    """
    temporary = tempfile.TemporaryDirectory(prefix=".steerlab-doctor-", dir=folder)
    with temporary as study, _display() as (events, screen):
        check = measure_loop(
            Path(study), events, screen, seconds, lambda share: progress("running the loop", share)
        )
        drawn = "none"
        if screen is not None:
            drawn = f"{screen.resolution}; sound {screen.loudspeaker.said}"
    return loop_checks(check, drawn)


def measure_loop(
    folder: Path,
    events: SdlEvents,
    screen: Screen | None,
    seconds: float,
    progress: ShareProgress = lambda share: None,
) -> LoopCheck:
    """Run the loop with a session recorder; leaves a study in ``folder``."""
    info = SessionInfo(
        participant=PARTICIPANT,
        role="check",
        device=DeviceInfo(kind=InputKind.WHEEL, name="virtual wheel"),
        control_hz=PacingConfig().control_hz,
    )
    with SessionRecorder(folder, info) as recorder:
        return check_loop(
            events,
            seconds=seconds,
            screen=screen,
            recorder=recorder,
            participant=PARTICIPANT,
            progress=progress,
        )


def loop_checks(check: LoopCheck, drawn: str) -> list[CheckResult]:
    """A line for each property of the loop; ``drawn`` is the resolution of the screen."""
    health, config = check.health, GateConfig()
    failed = {gate.name: gate for gate in check.failed}
    lost = check.expected_steps - health.steps
    shown = health.frames + health.dropped
    checks = [
        CheckResult(
            what="Control steps",
            found=f"{health.steps} taken, {lost} lost, {health.overruns} overran",
            ok=lost == 0 and "overrun_share" not in failed,
            mend=_mend(failed, "overrun_share"),
        ),
        CheckResult(
            what="Wake-up lateness",
            found=f"p50 {health.lateness_p50_ms:.3f}, p99 {health.lateness_p99_ms:.3f}, worst "
            f"{health.lateness_max_ms:.2f} ms (limits {config.lateness_p99_ms:g} and "
            f"{config.lateness_max_ms:g})",
            ok=not failed.keys() & {"lateness_p99_ms", "lateness_max_ms"},
            mend=_mend(failed, "lateness_p99_ms", "lateness_max_ms"),
        ),
        CheckResult(
            what="Input",
            found=f"a motion is known after p50 {check.input_p50_ms:.2f}, p99 "
            f"{check.input_p99_ms:.2f} ms, without the wheel's own delay",
            ok="input_age_p99_ms" not in failed,
            mend=_mend(failed, "input_age_p99_ms"),
        ),
        CheckResult(
            what="Recording",
            found=f"p50 {check.keep_p50_us:.1f}, p99 {check.keep_p99_us:.1f} µs a step in the loop",
            ok=check.keep_p99_us <= KEEP_P99_US,
            mend="" if check.keep_p99_us <= KEEP_P99_US else BUSY,
        ),
    ]
    if shown:
        checks.append(
            CheckResult(
                what="Display",
                found=f"{health.frames} frames, {health.dropped} left out "
                f"({health.dropped / shown:.1%}), p50 {health.frame_p50_ms:.1f}, p99 "
                f"{health.frame_p99_ms:.1f} ms, drawn at {drawn}",
                ok="dropped_share" not in failed,
                mend=_mend(failed, "dropped_share"),
            )
        )
    else:
        checks.append(CheckResult(what="Display", found="none here, so nothing was drawn", ok=True))
    load = "not told here" if check.load is None else f"{check.load:.2f} over the last minute"
    checks.append(CheckResult(what="Load", found=load, ok=True))
    return checks


def _mend(failed: dict[str, TimingViolation], *names: str) -> str:
    return next((MENDS[name] for name in names if name in failed), "")


@contextmanager
def _display() -> Generator[tuple[SdlEvents, DriveScreen | None]]:
    """The full screen where there is a display; else none, so that the loop alone runs."""
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    try:
        events = SdlEvents(window=has_display)
    except NoDisplay:
        events, has_display = SdlEvents(window=False), False
    as_participants = ScreenConfig(full_screen=True, sound=True)
    with events, DriveScreen(events, as_participants) if has_display else nullcontext() as screen:
        yield events, screen
