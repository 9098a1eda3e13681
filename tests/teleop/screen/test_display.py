"""The window on a real display: Xvfb, with xdotool for the hands."""

import os
import select
import shutil
import subprocess
import sys
from queue import Queue
from threading import Thread

import pytest

MISSING = [tool for tool in ("Xvfb", "xdotool") if shutil.which(tool) is None]
pytestmark = [
    pytest.mark.display,
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}"),
]
PATIENCE_S = 60.0  # a test that waits as long has failed

# Shows a drive and says what it hears, until it is stopped or its display is gone.
PROGRAM = """
import os, sys
from time import sleep
from steerlab.sim.errors import SteerlabError
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import WorldSpec
from steerlab.teleop.screen.contract import Act, DriveView
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents

class Picture:
    def __init__(self, world, camera): pass
    def frame(self, pose, road_wheel_rad, out): return out
    def close(self): print("picture closed", flush=True)

def run():
    with SdlEvents(window=True) as events, DriveScreen(events, make_picture=Picture) as screen:
        world = WorldSpec(name="open", ball_xy_m=(30.0, 0.0), start=Pose2D(0.0, 0.0, 0.0))
        screen.enter(world)
        focused = None
        while True:
            events.poll()
            acts = screen.acts()
            for act in acts:
                print(act.value, flush=True)
            if screen.focused != focused:
                focused = screen.focused
                print("focused" if focused else "not focused", flush=True)
            if Act.STOP in acts:
                return
            screen.show_drive(DriveView(pose=world.start, elapsed_s=1.0, number=1, count=12,
                                        needle=0.0, device="G29"))
            sleep(0.01)

try:
    run()
except SteerlabError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""


class Display:
    """An X server of its own."""

    def __init__(self) -> None:
        reading, writing = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24", "-nolisten", "tcp"],
            pass_fds=[writing],
            stderr=subprocess.DEVNULL,
        )
        os.close(writing)
        with os.fdopen(reading) as number:
            assert select.select([number], [], [], PATIENCE_S)[0], "Xvfb did not start"
            self.environment = {
                name: value for name, value in os.environ.items() if name != "SDL_VIDEODRIVER"
            } | {"DISPLAY": f":{number.readline().strip()}"}

    def xdotool(self, *words) -> str:
        done = subprocess.run(
            ["xdotool", *words], env=self.environment, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def end(self) -> None:
        self.server.kill()
        self.server.wait()


@pytest.fixture
def display():
    display = Display()
    yield display
    display.end()


class Program:
    """``PROGRAM`` on a display."""

    def __init__(self, display: Display) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env=display.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._said: Queue[str] = Queue()
        self._reader = Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self._said.put(line.strip())
        self._said.put("ended")

    def hear(self, wanted: str) -> list[str]:
        """What it says until it says ``wanted``."""
        said = []
        while wanted not in said:
            assert "ended" not in said, (said, self.process.stderr.read())
            said.append(self._said.get(timeout=PATIENCE_S))
        return said

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        self.process.stdout.close()
        self.process.stderr.close()


@pytest.fixture
def program(display):
    program = Program(display)
    yield program
    program.end()


def _ended(program) -> tuple[int, str]:
    """Exit code and what it complained about."""
    return program.process.wait(PATIENCE_S), program.process.stderr.read()


def test_keys_and_focus(display, program):
    program.hear("focused")
    window = display.xdotool("getwindowfocus")
    assert display.xdotool("getwindowname", window) == "steerlab"
    assert display.xdotool("getwindowgeometry", window).endswith("960x540")
    for keys, act in (
        (["p"], "pause"),
        (["r", "r"], "redo"),
        (["space"], "confirm"),
        (["Return"], "confirm"),
    ):
        display.xdotool("key", *keys)
        assert program.hear(act) == [act]
    root = display.xdotool("search", "--maxdepth", "0", ".*").splitlines()[0]
    display.xdotool("windowfocus", root)
    assert program.hear("not focused") == ["focus_lost", "not focused"]
    display.xdotool("windowfocus", window)
    program.hear("focused")
    display.xdotool("key", "Escape", "Escape")
    assert program.hear("ended") == ["stop", "picture closed", "ended"]
    assert _ended(program) == (0, "")


def test_a_monitor_that_is_not_there_is_one_sentence_that_lists_those_there_are(display, tmp_path):
    arguments = ["drive", "--device", "keyboard", "--no-pedals", "--monitor", "3", "--no-sound"]
    done = subprocess.run(
        [sys.executable, "-m", "steerlab.app.cli", *arguments],
        env=display.environment | {"XDG_CONFIG_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 2
    said = done.stderr.strip().splitlines()[-1]
    assert said.startswith("steerlab: No monitor '3' here; there is 0 (")
    assert said.endswith(", 1280x800).")
    assert "Traceback" not in done.stderr


def test_a_display_that_vanishes_is_said_and_everything_is_closed(display, program):
    """Xlib would end the process here, with exit code 1 and no ``finally``."""
    program.hear("focused")
    display.end()
    assert program.hear("ended")[-2:] == ["picture closed", "ended"]
    code, errors = _ended(program)
    assert errors.startswith("The display has gone away")
    assert len(errors.splitlines()) == 1
    assert code == 2


def test_a_window_that_is_killed_is_said_too(display, program):
    program.hear("focused")
    display.xdotool("windowkill", display.xdotool("getwindowfocus"))
    assert program.hear("ended")[-2:] == ["picture closed", "ended"]
    code, errors = _ended(program)
    assert errors.startswith("The display has gone away")
    assert code == 2
