"""Does the loop keep time? A virtual wheel, a window under Xvfb, everything recorded.

``python -m benchmarks.teleop [--seconds 300]``; the load of the machine is in the rows' names,
for on a busy machine these figures say nothing.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.rows import Row, at_most, print_rows
from steerlab.app.loop_check import measure_loop
from steerlab.sim.errors import SteerlabError
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents

SECONDS = 60.0
WAKE_P99_LIMIT_MS = 2.0
ENQUEUE_P99_LIMIT_US = 50.0
KEEP_P50_LIMIT_US = 100.0


def run(seconds: float = SECONDS) -> list[Row]:
    """Every figure of the loop, at 960x540, 20 Hz control and 60 Hz display."""
    load = os.getloadavg()[0]
    with (
        tempfile.TemporaryDirectory() as folder,
        xvfb(),
        SdlEvents(window=True) as events,
        DriveScreen(events) as screen,
    ):
        check = measure_loop(Path(folder), events, screen, seconds)
        drawn = str(screen.resolution)
    health = check.health
    minutes = health.steps / 20.0 / 60.0
    shown = health.frames + health.dropped
    at = f"load {load:.1f} before, {check.load:.1f} after"
    return [
        at_most(
            f"control steps lost in {minutes:.1f} min",
            check.expected_steps - health.steps,
            0,
            "steps",
        ),
        at_most("control steps a display frame late", health.overruns, 0, "steps"),
        at_most(f"wake-up lateness p99 ({at})", health.lateness_p99_ms, WAKE_P99_LIMIT_MS, "ms"),
        at_most("wake-up lateness, worst", health.lateness_max_ms, 10.0, "ms"),
        at_most("handing over a step p99", check.keep_p99_us, ENQUEUE_P99_LIMIT_US, "µs"),
        at_most("handing over a step p50", check.keep_p50_us, KEEP_P50_LIMIT_US, "µs"),
        at_most("motion to sample p99", check.input_p99_ms, 5.0, "ms"),
        at_most(f"display frames left out, {drawn}", 100.0 * health.dropped / shown, 0.5, "%"),
        at_most("display frame p99", health.frame_p99_ms, 1000.0 / 60.0, "ms"),
    ]


@contextmanager
def xvfb() -> Generator[None]:
    """A display of our own, so that nothing else is on it.

    Raises:
        SteerlabError: Xvfb is not installed or did not start.
    """
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x720x24", "-nolisten", "tcp"]
    try:
        process = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    except FileNotFoundError:
        raise SteerlabError("Xvfb is not installed; run: apt-get install xvfb") from None
    finally:
        os.close(write)
    before = os.environ.get("DISPLAY")
    try:
        with os.fdopen(read) as told:
            number = told.readline().strip()
        if not number:
            raise SteerlabError("Xvfb did not start; run it by hand to see why.")
        os.environ["DISPLAY"] = f":{number}"
        yield
    finally:
        if before is None:
            os.environ.pop("DISPLAY", None)
        else:
            os.environ["DISPLAY"] = before
        process.terminate()
        process.wait()


if __name__ == "__main__":
    chosen = float(sys.argv[2]) if sys.argv[1:2] == ["--seconds"] else SECONDS
    sys.exit(print_rows(run(chosen)))
