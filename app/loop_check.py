"""How well does this machine keep time? The whole loop, driven by a wheel that needs no hardware."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import pi, sin
from threading import Event, Thread
from time import perf_counter_ns, sleep
from typing import Any

import numpy as np

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.machine import load_average
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.attempt import AttemptRecord, Recorder
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
from steerlab.teleop.screen.contract import DriveView, Screen
from steerlab.teleop.sdl import SdlEvents
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import GateConfig, LoopHealth, TimingViolation, failed_gates

TURN_HZ = 0.4  # the wheel goes from side to side this often
MOVES_HZ = 250.0  # and is moved this often, as a wheel reports
AXES = 4
RAW_MAX = 32767  # of SDL's axes
HEARD_WITHIN_MS = 2000


@dataclass(frozen=True, kw_only=True)
class LoopCheck:
    """What was measured.

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
    """A virtual wheel that a thread of its own turns to and fro, noting when it moved where."""

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
    progress: Callable[[float], None] = lambda share: None,
) -> LoopCheck:
    """Replay the calibration set for some seconds with everything on but a person.

    Args:
        screen: None leaves the display out.
        recorder: keeps the steps as in a real session.

    Raises:
        SteerlabError: no step was due in that time.
    """
    timings: list[StepTiming] = []
    frame_ns: list[int] = []
    inputs_ms: list[float] = []
    keep_ns: list[int] = []
    dropped = expected = 0
    clock = WallClock(PacingConfig(), events.poll)
    with VirtualJoystick(axes=AXES) as joystick, MovingWheel(joystick) as mover:
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
                    show=None if screen is None else _shower(screen, drive, device, clock),
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


class _Measuring:
    """Passes steps on, timing that, and looks up when the wheel was where the label says."""

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
    """The virtual wheel's, which needs no wizard: it is exact."""
    profile = WheelProfile(
        name=joystick.name,
        match=ProfileMatch(vendor=LOGITECH, products=(G920,), axes=AXES, system=this_system()),
        steering=SteeringAxis(axis=0, sign=1),
        measured=Measured(resolution=0.0, rate_hz=MOVES_HZ, noise=0.0, return_error=0.0),
        calibrated=True,
    )
    return StoredProfile(profile=profile, file="virtual", sha256="", shipped=False)


def _until_heard(device: WheelDevice, poll: Callable[[], None]) -> None:
    """The wheel moves all the time, so this takes milliseconds."""
    for _ in range(HEARD_WITHIN_MS):
        poll()
        if device.read().ok:
            return
        sleep(0.001)
    raise SteerlabError(
        "The virtual wheel moves and SDL does not pass it on; is another SDL in use?"
    )


def _shower(
    screen: Screen, drive: Drive, device: WheelDevice, clock: WallClock
) -> Callable[[float], None]:
    def show(fraction: float) -> None:
        moment, sample = drive.between(fraction), device.read()
        screen.show_drive(
            DriveView(
                pose=moment.pose,
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
