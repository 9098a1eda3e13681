"""``steerlab doctor --loop``: does this machine keep time? The loop itself, as findings."""

import os
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from steerlab.app.doctor import CheckResult
from steerlab.app.loop_check import LoopCheck, check_loop
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.teleop.devices.contract import DeviceInfo, InputKind
from steerlab.teleop.pacing import PacingConfig
from steerlab.teleop.screen.contract import Screen
from steerlab.teleop.screen.drive_screen import DriveScreen, open_screen
from steerlab.teleop.sdl import NoDisplay, SdlEvents
from steerlab.teleop.timing_limits import GateConfig, TimingViolation

BUSY = "Close other programs, set the processor to full speed, and try again."
DRAWING = "Use a smaller window (--size 960x540) or a machine with a graphics driver."
MENDS = {
    "lateness_p99_ms": BUSY,
    "lateness_max_ms": BUSY,
    "overrun_share": BUSY,
    "dropped_share": DRAWING,
    "input_age_p99_ms": BUSY,
}
PARTICIPANT = "doctor"
KEEP_P99_US = 100.0  # handing a step to the recorder may cost the loop this much


def examine_loop(
    folder: Path, seconds: float, progress: Callable[[str, float], None]
) -> list[CheckResult]:
    """Run the loop for some seconds; without a display only the control steps are judged.

    Args:
        folder: where studies are kept: the throw-away study is made there, on the same disk.
    """
    temporary = tempfile.TemporaryDirectory(prefix=".steerlab-doctor-", dir=folder)
    with temporary as place, _display() as (events, screen):
        check = measure_loop(
            Path(place), events, screen, seconds, lambda share: progress("running the loop", share)
        )
        drawn = "none" if screen is None else str(screen.resolution)
    return loop_findings(check, drawn)


def measure_loop(
    folder: Path,
    events: SdlEvents,
    screen: Screen | None,
    seconds: float,
    progress: Callable[[float], None] = lambda share: None,
) -> LoopCheck:
    """The loop with a recorder of its own; leaves a study in ``folder``."""
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


def loop_findings(check: LoopCheck, drawn: str) -> list[CheckResult]:
    """A line for each thing that can be bad."""
    health, config = check.health, GateConfig()
    failed = {gate.name: gate for gate in check.failed}
    lost = check.expected_steps - health.steps
    shown = health.frames + health.dropped
    findings = [
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
        findings.append(
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
        findings.append(
            CheckResult(what="Display", found="none here, so nothing was drawn", ok=True)
        )
    load = "not told here" if check.load is None else f"{check.load:.2f} over the last minute"
    findings.append(CheckResult(what="Load", found=load, ok=True))
    return findings


def _mend(failed: dict[str, TimingViolation], *names: str) -> str:
    return next((MENDS[name] for name in names if name in failed), "")


@contextmanager
def _display() -> Generator[tuple[SdlEvents, DriveScreen | None]]:
    """A window where there is a display; without one the loop alone is measured, and said so."""
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    try:
        events = SdlEvents(window=has_display)
    except NoDisplay:
        events, has_display = SdlEvents(window=False), False
    with events:
        if not has_display:
            yield events, None
            return
        with open_screen(events) as screen:
            yield events, screen
