"""The Rerun viewer as a program: found, started, opened on a file, and made to draw a picture."""

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Self

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.own_process import apart_from_terminal
from steerlab.sim.files.refusal import refusal

if TYPE_CHECKING:
    from rerun.experimental import Recording, ViewerClient

EXECUTABLE = "STEERLAB_RERUN"  # environment variable: another viewer than the installed one
MEMORY_LIMIT = "1GB"  # of what the viewer keeps; beyond it the oldest goes
START_S = 15.0
WINDOW_S = 1.0  # it listens before it opens its window, and ends if it cannot open one
DRAW_S = 60.0
SETTLE_S = 9.0  # until shaders are compiled and the notes at the top right have gone
VULKAN_HINT = "sudo apt-get install -y mesa-vulkan-drivers"
_LOCAL = "127.0.0.1"


class RecordingUnavailable(SteerlabError):
    """A recording cannot be chosen, written, opened or drawn."""


def rerun_executable() -> Path:
    """The viewer's program, beside its library whether or not that folder is on the PATH.

    Raises:
        RecordingUnavailable: there is none; says how to get it.
    """
    chosen = os.environ.get(EXECUTABLE)
    candidates: list[Path] = []
    if chosen:
        candidates = [Path(chosen)]
    else:
        spec = find_spec("rerun_cli")
        if spec is not None and spec.origin is not None:
            candidates += [Path(spec.origin).parent / name for name in ("rerun", "rerun.exe")]
        if on_path := shutil.which("rerun"):
            candidates.append(Path(on_path))
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    where = f"{EXECUTABLE} is {chosen!r}, which is no file" if chosen else "it is not installed"
    raise RecordingUnavailable(
        f"The Rerun viewer cannot be started: {where}. Install it with pip install rerun-sdk."
    )


class ViewerProcess:
    """A running viewer that listens on this machine only; it is ended by ``close``.

    Args:
        arguments: further ones of the ``rerun`` program, such as files to open.
        headless: without a window.
        port: to listen on; a free one by default.

    Raises:
        RecordingUnavailable: it is not installed, or did not come up; says why.
    """

    def __init__(
        self,
        *arguments: str,
        headless: bool = False,
        port: int | None = None,
        size_px: tuple[int, int] | None = None,
        start_s: float = START_S,
    ) -> None:
        self.port = port or _free_port()
        command = [str(rerun_executable()), "--bind", _LOCAL, "--port", str(self.port)]
        command += ["--memory-limit", MEMORY_LIMIT, "--hide-welcome-screen"]
        command += ["--headless"] if headless else []
        command += ["--window-size", "{}x{}".format(*size_px)] if size_px else []
        # a file: the viewer would stall on a full pipe that nobody reads
        self._output = tempfile.TemporaryFile()  # noqa: SIM115
        try:
            self._process = subprocess.Popen(
                [*command, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                env={**os.environ, "RERUN_APP_ONLY": "true", "NO_COLOR": "1", "RUST_LOG": "info"},
                **apart_from_terminal(),
            )
        except OSError as error:
            self._output.close()
            raise RecordingUnavailable(
                f"The Rerun viewer cannot be started: "
                f"{refusal(error, 'install it with pip install rerun-sdk')}."
            ) from error
        self._wait_until_up(start_s, 0.0 if headless else WINDOW_S)

    @property
    def url(self) -> str:
        """Where streams connect to."""
        return f"rerun+http://{_LOCAL}:{self.port}/proxy"

    @property
    def alive(self) -> bool:
        """It has not been closed."""
        return self._process.poll() is None

    def wait(self) -> None:
        """Until its window is closed."""
        self._process.wait()

    def close(self) -> None:
        """End it, also if it hangs; calling it again does nothing."""
        if self.alive:
            self._process.kill()  # there is nothing to save in it
        self._process.wait()
        self._output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _wait_until_up(self, start_s: float, window_s: float) -> None:
        deadline_s = monotonic() + start_s
        while self.alive and monotonic() < deadline_s:
            if listens(self.port):
                sleep(window_s)
                if self.alive:
                    return
            sleep(0.02)
        self._output.seek(0)
        lines = self._output.read().decode(errors="replace").strip().splitlines()
        self.close()
        raise RecordingUnavailable(
            f"The Rerun viewer did not come up: {_reason(lines)} It needs a display and a "
            f"graphics driver; without a graphics card: {VULKAN_HINT}"
        )


def listens(port: int) -> bool:
    """Whether a program on this machine takes connections at ``port``."""
    try:
        socket.create_connection((_LOCAL, port), timeout=0.2).close()
    except OSError:
        return False
    return True


def open_in_viewer(files: Sequence[Path]) -> None:
    """Show recordings in a window, and return when it is closed.

    Raises:
        RecordingUnavailable: there is no viewer or no display.
    """
    with ViewerProcess(*map(str, files)) as viewer:
        viewer.wait()


def screenshot(
    recording: Path,
    png: Path,
    *,
    at_s: float | None = None,
    size_px: tuple[int, int] = (1600, 900),
) -> None:
    """Draw the first recording of a file as the viewer shows it, without a display.

    Args:
        at_s: time since the attempt's start; two thirds of it by default.

    Raises:
        RecordingUnavailable: there is no viewer, no graphics driver, or it drew nothing.
    """
    from rerun.experimental import ViewerClient

    from steerlab.study.recording.layout import TIME

    png.parent.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        ViewerProcess(headless=True, size_px=size_px) as viewer,
    ):
        drawn = Path(folder) / "drawn.png"
        try:
            client = ViewerClient.connect(viewer.url)
            client.open(str(recording.resolve()))
            recordings = _loaded(client)
            first = recordings[0]
            length_ns = {t.name: t.end or 0 for t in first.timelines}.get(TIME, 0)
            client.set_location(first.location)
            moment_s = length_ns / 1e9 * 2.0 / 3.0 if at_s is None else at_s
            client.set_time(TIME, duration=moment_s, play_state="paused")
            sleep(SETTLE_S)
            client.save_screenshot(str(drawn))
        except (RuntimeError, ConnectionError, TimeoutError) as error:
            raise RecordingUnavailable(
                f"The Rerun viewer drew no picture of {recording}: {error}. Without a graphics "
                f"card: {VULKAN_HINT}"
            ) from error
        if not drawn.is_file():
            raise RecordingUnavailable(f"The Rerun viewer wrote no picture of {recording}.")
        shutil.move(drawn, png)


def _loaded(client: "ViewerClient") -> list["Recording"]:
    """Recordings once all of them have arrived."""
    deadline_s = monotonic() + DRAW_S
    while monotonic() < deadline_s:
        state = client.get_state()
        if state.recordings and not state.loading and all(r.timelines for r in state.recordings):
            return state.recordings
        sleep(0.1)
    raise TimeoutError(f"it had not loaded after {DRAW_S:g} s")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_LOCAL, 0))
        return probe.getsockname()[1]


def _reason(lines: list[str]) -> str:
    """The last line of the viewer's output that names an error."""
    errors = [line for line in lines if "error" in line.lower() or "panicked" in line]
    last = (errors or lines or ["it said nothing"])[-1].strip()
    return last if last.endswith(".") else f"{last}."
