"""What the system says of the machine; not every system says everything."""

import os
import platform
import sys
from pathlib import Path

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.refusal import ran_out

FEWEST_HANDLES = 48  # a recorded drive takes 17 in all, a run shared by six processes 27
_MOST_ON_WINDOWS = 61  # ProcessPoolExecutor's limit: Windows waits for no more processes at once


def available_cores() -> int:
    """Cores that this process may use: on Linux those that it was given, elsewhere all."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def worker_count(jobs: int, tasks: int) -> int:
    """Processes to start for ``tasks`` when ``jobs`` are asked for; Windows manages 61."""
    return min(jobs, tasks, _MOST_ON_WINDOWS) if sys.platform == "win32" else min(jobs, tasks)


def check_handles(needed: int = FEWEST_HANDLES) -> None:
    """Refuse to begin with few file handles: libraries such as Rerun end the program without them.

    Raises:
        SteerlabError: fewer than ``needed`` are free of those that this program may have.
    """
    try:
        from resource import RLIM_INFINITY, RLIMIT_NOFILE, getrlimit
    except ImportError:  # Windows has no such limit
        return
    allowed, _ = getrlimit(RLIMIT_NOFILE)
    if allowed == RLIM_INFINITY:
        return
    try:
        free = allowed - len(os.listdir("/dev/fd"))
    except OSError as error:
        if not ran_out(error):
            raise
        free = 0
    if free < needed:
        raise SteerlabError(
            f"This program may open only {allowed} files at a time, of which {max(free, 0)} are "
            f"left, and needs {needed}: allow more open files (ulimit -n), such as ulimit -n 1024."
        )


def load_average() -> float | None:
    """How many programs wanted a core over the last minute; None on Windows, which keeps no count."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def cpu_model() -> str:
    """The processor's name as the system gives it; elsewhere than on Linux it may be coarse."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
