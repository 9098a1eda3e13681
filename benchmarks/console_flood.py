"""Does a flood of requests to the console make the wheel late? Linux; ``python -m benchmarks.console_flood``.

The wheel's loop (20 Hz, no window) and the console share one processor, the worst case; whoever
sends the flood has the others, as another computer would. The loop runs alone, beside a flooded
console of usual priority, and beside one that gives way.
"""

import os
import re
import socket
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import numpy as np

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.app.console.priority import NICENESS
from steerlab.study.study_folder import new_study
from steerlab.teleop.pacing import PacingConfig, WallClock, no_garbage_collection

SECONDS = 20.0
FLOODERS = 8
LATE_P99_MS = 2.0  # as for a wheel at rest, in benchmarks.teleop
CONSOLE = """
import sys
from steerlab.app.console import priority
priority.NICENESS = int(sys.argv[1])
from steerlab.app.cli import main
sys.exit(main(["console", sys.argv[2], "--port", "0"]))
"""


def run(seconds: float = SECONDS) -> list[Row]:
    """Lateness of the loop's steps, and how many requests came meanwhile."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study"
        new_study(study, "mind-meld")
        late_ms = {"alone": _wheel(seconds)}
        late_ms["console of usual priority"], _ = _flooded(study, 0, seconds)
        late_ms["console that gives way"], answered = _flooded(study, NICENESS, seconds)
    return [
        *(
            at_most(f"late, {name}, p99", p99, LATE_P99_MS, "ms")
            for name, (p99, _) in late_ms.items()
        ),
        *(
            at_most(f"late, {name}, worst", worst, 10.0, "ms")
            for name, (_, worst) in late_ms.items()
        ),
        at_least("answers to the flood meanwhile", answered / seconds, 10, "1/s"),
    ]


def _flooded(study: Path, niceness: int, seconds: float) -> tuple[tuple[float, float], int]:
    """How late the loop is beside a flooded console, and how often that answered."""
    command = [sys.executable, "-c", CONSOLE, str(niceness), str(study)]
    with _on({min(os.sched_getaffinity(0))}):
        console = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert console.stdout is not None
    over, answered = Event(), [0] * FLOODERS
    try:
        found = re.search(r"http://([^:]+:(\d+))/enter", console.stdout.readline())
        if found is None:
            raise SystemExit("The console did not start.")
        host, port = found.group(1), int(found.group(2))

        def flood(number: int) -> None:
            question = f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
            with socket.create_connection(("127.0.0.1", port)) as connection:
                while not over.is_set():
                    connection.sendall(question)
                    connection.recv(65536)
                    answered[number] += 1

        flooders = [Thread(target=flood, args=(number,)) for number in range(FLOODERS)]
        with _on(_others()):
            for flooder in flooders:
                flooder.start()
        late_ms = _wheel(seconds)
        over.set()
        for flooder in flooders:
            flooder.join()
    finally:
        console.kill()
        console.wait()
        console.stdout.close()
    return late_ms, sum(answered)


def _wheel(seconds: float) -> tuple[float, float]:
    """How late the loop is, p99 and worst, in milliseconds, in a process and a session of its own, as a drive has them."""
    command = [sys.executable, "-m", "benchmarks.console_flood", "--wheel", str(seconds)]
    with _on({min(os.sched_getaffinity(0))}):
        wheel = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    said, _ = wheel.communicate()
    p99_ms, worst_ms = said.split()
    return float(p99_ms), float(worst_ms)


def _loop(seconds: float) -> tuple[float, float]:
    clock = WallClock(PacingConfig(), lambda: None)
    with no_garbage_collection():
        clock.start()
        ticks = [clock.wait_for(step, None) for step in range(round(20 * seconds))]
    late_ms = [(tick.actual_ns - tick.deadline_ns) / 1e6 for tick in ticks]
    return float(np.percentile(late_ms, 99)), max(late_ms)


@contextmanager
def _on(processors: set[int]) -> Generator[None]:
    """What is started in the block runs on these processors alone."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, processors)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _others() -> set[int]:
    every = os.sched_getaffinity(0)
    return every - {min(every)} or every


if __name__ == "__main__":
    if sys.argv[1:2] == ["--wheel"]:
        print(*_loop(float(sys.argv[2])))
    else:
        raise SystemExit(print_rows(run()))
