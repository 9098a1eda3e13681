"""Long work in processes of their own: phases at the wheel, and erasing a participant's data.

Erasing may train the network anew, which would hold up every page if the console did it.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock

from steerlab.app.console import texts
from steerlab.sim.files.own_process import apart_from_terminal
from steerlab.study.contract import Phase, StudyError

STUDY_COMMAND = (sys.executable, "-m", "steerlab.app.cli", "study")
LAST_LINES = 12
LAST_BYTES = 4096
AT_UTC = "%Y-%m-%dT%H:%M:%SZ"
_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, kw_only=True, slots=True)
class RunView:
    """The run that is going on, or the last one.

    Attributes:
        phase: its id; empty while data are erased.
        since: when it began, in UTC, as the study keeps times.
        code: the exit code; None while it goes on.
        last_lines: of what it wrote.
        stopping: the experimenter has asked it to stop.
    """

    participant: str
    phase: str
    title: str
    pid: int
    since: str
    code: int | None
    last_lines: tuple[str, ...]
    stopping: bool = False

    @property
    def goes_on(self) -> bool:
        """Whether the process still runs."""
        return self.code is None


class WheelRuns:
    """Starts one process at a time; a process goes on if the console ends.

    It has the priority that the console had when this was made, and not what ``give_way`` leaves.
    """

    def __init__(
        self,
        folder: Path,
        *,
        device: str = "wheel",
        command: Sequence[str] = STUDY_COMMAND,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        """For the study in ``folder``; ``device`` as for ``steerlab study run``."""
        self._folder = folder.absolute()
        self._device = device
        self._command = tuple(command)
        self._now = now
        self._process: subprocess.Popen[bytes] | None = None
        self._output: RunOutput | None = None
        self._what = ("", "", "")  # participant, phase, title
        self._since = now()
        self._stops = 0
        self._tried: set[tuple[str, str]] = set()
        self._to_erase: list[str] = []
        # A process gets the priority of the thread that starts it, and a thread that of its own.
        self._starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="runs")
        self._starter.submit(os.getpid).result()  # it would begin with the first run only

    def view(self) -> RunView | None:
        """The current or last run; None before the first."""
        if self._process is None:
            return None
        participant, phase, title = self._what
        return RunView(
            participant=participant,
            phase=phase,
            title=title,
            pid=self._process.pid,
            since=self._since.strftime(AT_UTC),
            code=self._process.poll(),
            last_lines=self._last_lines(),
            stopping=self._stops > 0,
        )

    def mark(self) -> str:
        """Differs whenever a run was started or ended."""
        if self._process is None:
            return "none"
        waiting = "".join(f":{one}" for one in self._to_erase)
        return f"{self._process.pid}:{self._process.poll()}:{self._stops}{waiting}"

    def tried(self, participant: str, phase: str) -> bool:
        """Whether it was started here since it became what is next for the participant."""
        return (participant, phase) in self._tried

    def next_are(self, steps: Collection[tuple[str, str]]) -> None:
        """Participant and phase of all that is next now; what was tried of others is forgotten."""
        self._tried.intersection_update(steps)

    def start(self, participant: str, phase: Phase) -> None:
        """Begin or resume a phase.

        Args:
            participant, phase: as the study gives them; never what a form says.

        Raises:
            StudyError: another one runs, a name could be taken for an option, or the system starts
                no more processes.
        """
        _check_names(participant, phase.id)
        self._tried.add((participant, phase.id))  # also if it cannot be started
        options = ("--participant", participant, "--phase", phase.id, "--device", self._device)
        self._start(participant, phase.id, phase.title, "run", *options)

    def erase(self, participant: str) -> None:
        """Withdraw a participant and erase their data.

        Raises:
            StudyError: as for ``start``.
        """
        _check_names(participant)
        self._start(participant, "", texts.ERASING, "withdraw", participant, "--erase")

    @property
    def to_erase(self) -> tuple[str, ...]:
        """Whose data are erased once nothing runs any more."""
        return tuple(self._to_erase)

    def erase_later(self, participant: str) -> None:
        """Erase a participant's data once nothing runs any more; lost if the console ends before."""
        _check_names(participant)
        if participant not in self._to_erase:
            self._to_erase.append(participant)

    def erase_waiting(self) -> None:
        """Begin what ``erase_later`` was told, if there is anything.

        Raises:
            StudyError: as for ``start``.
        """
        if self._to_erase:
            self.erase(self._to_erase[0])
            del self._to_erase[0]  # if it could not be started, it is due with the next change

    def stop(self, participant: str, phase: str) -> None:
        """Ask the phase's process to end in order, as Esc does; asked again, end it at once.

        What was finished is kept either way; a drive that is cut off does not count.
        """
        run = self.view()
        if self._process is None or run is None or not run.goes_on:
            return
        if not phase or (run.participant, run.phase) != (participant, phase):
            return  # the page was out of date; erasing is never cut off
        if self._stops:
            self._process.kill()
        else:
            self._process.terminate()
        self._stops += 1

    def _start(self, participant: str, phase: str, title: str, act: str, *options: str) -> None:
        current = self.view()
        if current is not None and current.goes_on:
            raise StudyError(
                texts.RUN_BUSY.format(
                    title=current.title, participant=current.participant, pid=current.pid
                )
            )
        command = [*self._command, act, str(self._folder), *options]
        output = None
        try:
            output = RunOutput()
            process = self._starter.submit(_started, command, output).result()
        except OSError as error:
            if output is not None:
                output.close()
            raise StudyError(texts.RUN_NOT_STARTED.format(title=title, error=error)) from error
        self._close_output()
        self._process, self._output = process, output
        self._output.handed_over()
        self._what, self._since, self._stops = (participant, phase, title), self._now(), 0

    def wait(self, longest_s: float) -> None:
        """Until the current run has ended, if it does so soon."""
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(longest_s)

    def close(self) -> None:
        """Forget the run; it goes on if it has not ended."""
        self._close_output()
        self._starter.shutdown()

    def _close_output(self) -> None:
        if self._output is not None:
            self._output.close()
            self._output = None

    def _last_lines(self) -> tuple[str, ...]:
        if self._output is None:
            return ()
        tail = self._output.tail(LAST_BYTES).decode("utf-8", "replace")
        lines = [line.rstrip() for line in tail.splitlines()]
        return tuple(line for line in lines if line)[-LAST_LINES:]


def _started(command: Sequence[str], output: "RunOutput") -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=output.sink,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},  # as it is read; Windows has others
        **apart_from_terminal(),
    )


def _check_names(*names: str) -> None:
    for name in names:
        if not _PLAIN.fullmatch(name):
            raise StudyError(f"{name!r} cannot be an id; use letters, digits, '-' and '_'.")


class RunOutput:
    """What a process writes, in a file: unlike a pipe, it goes on if the console ends.

    Its name is removed at once, so nothing is left of it when both processes have ended. Windows
    cannot remove the name of an open file: there it stays in the folder for temporary files until
    ``close``, and longer if the process still writes or the console was killed.

    Attributes:
        sink: for the process's stdout; ``handed_over`` closes it here.
    """

    def __init__(self) -> None:
        handle, name = tempfile.mkstemp(prefix="steerlab-run-")
        self._path = Path(name)
        self.sink = os.fdopen(handle, "wb")
        self._reading = self._path.open("rb")  # its position is not that of the process
        self._lock = Lock()
        self._forget_name()

    def handed_over(self) -> None:
        """The process has the sink."""
        self.sink.close()

    def tail(self, most: int) -> bytes:
        """The last ``most`` bytes so far."""
        with self._lock:
            size = self._reading.seek(0, os.SEEK_END)
            self._reading.seek(max(0, size - most))
            return self._reading.read(most)

    def close(self) -> None:
        """Read no more; the process may go on writing."""
        self.sink.close()
        self._reading.close()
        self._forget_name()

    def _forget_name(self) -> None:
        with suppress(PermissionError):  # Windows, while it is open
            self._path.unlink(missing_ok=True)
