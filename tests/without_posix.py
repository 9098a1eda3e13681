"""A program: takes from steerlab's own code what Windows has not, then does what it is told.

``without_posix.py import`` imports every module of steerlab; any other arguments are those of the
command line, with ``::`` between two commands.

Modules that only POSIX has can be imported by nobody, but for what ``NEEDS_THEM_HERE`` has got hold
of before. Functions that only POSIX has are missing where steerlab's code looks for them: numpy
and torch choose theirs by ``sys.platform``, so on Linux they would not even be imported without.
It reads nothing from ``/proc``, and opens no folder. A file that steerlab opens as text without
saying in which encoding is an error, for on Windows that would not be UTF-8.
"""

import builtins
import importlib
import os
import select
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

TOP = Path(__file__).parents[1]
LAYERS = ("assets", "sim", "learning", "teleop", "study", "analysis", "app")

MODULES = ("crypt", "curses", "evdev", "fcntl", "grp", "nis", "pty", "pwd", "readline", "resource")
MODULES += ("spwd", "syslog", "termios", "tty")
NEEDS_THEM_HERE = ("asyncio", "filelock", "psutil")  # on Windows they do without
NAMES = {
    os: (
        *("O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "WNOHANG", "chown"),
        *("chroot", "fchdir", "fchmod", "fchown", "fdatasync", "fork", "forkpty", "getegid"),
        *("geteuid", "getgid", "getgroups", "getloadavg", "getpgid", "getpgrp", "getpriority"),
        *("getsid", "getuid", "killpg", "lchown", "lockf", "memfd_create", "mkfifo", "mknod"),
        *("nice", "openpty", "pread", "pwrite", "register_at_fork", "sched_getaffinity"),
        *("sched_setaffinity", "sendfile", "setpgid", "setpriority", "setsid", "setuid"),
        *("statvfs", "sync", "sysconf", "uname", "wait3", "wait4", "waitid"),
    ),
    select: ("epoll", "poll"),
    signal: (
        *("SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2"),
        *("alarm", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "sigwait"),
    ),
    time: ("clock_gettime", "clock_settime", "pthread_getcpuclockid", "tzset"),
}


class _AsSeen(ModuleType):
    """A module without some of its names."""

    def __init__(self, real: ModuleType, without: tuple[str, ...]) -> None:
        super().__init__(real.__name__)
        self._real, self._without = real, without

    def __getattr__(self, name: str) -> Any:
        if name in self._without:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r} on Windows")
        return getattr(self._real, name)


def hide() -> None:
    """From what is imported from now on."""
    for name in NEEDS_THEM_HERE:
        importlib.import_module(name)
    for name in MODULES:
        sys.modules[name] = None  # type: ignore[assignment] (importing it fails from now on)
    seen = {module.__name__: _AsSeen(module, names) for module, names in NAMES.items()}
    find = builtins.__import__

    def import_as_seen(name: str, space: Any = None, *rest: Any, **more: Any) -> Any:
        if name in seen and _is_ours((space or {}).get("__name__", "")):
            return seen[name]
        return find(name, space, *rest, **more)

    builtins.__import__ = import_as_seen
    sys.addaudithook(_refuse_to_open)
    warnings.filterwarnings("error", category=EncodingWarning, module=r"steerlab\.")


def _is_ours(module: str) -> bool:
    return module.startswith("steerlab.")


def _refuse_to_open(event: str, arguments: tuple[Any, ...]) -> None:
    if event != "open" or not isinstance(arguments[0], str | os.PathLike):
        return
    path = os.fspath(arguments[0])
    if not _is_ours(_who_opens()):  # numba asks what processor it compiles for, in its own way
        return
    if path.startswith(("/proc/", "/sys/")):
        raise FileNotFoundError(2, "No such file or directory", path)
    if os.path.isdir(path):
        raise PermissionError(13, "Permission denied", path)


def _who_opens() -> str:
    """The module whose code opens a file, by itself or through ``pathlib``."""
    frame = sys._getframe(2)
    while frame.f_back and frame.f_globals["__name__"].partition(".")[0] in ("pathlib", "io"):
        frame = frame.f_back
    return frame.f_globals["__name__"]


def import_all() -> int:
    """Import every module of steerlab; how many cannot be, without those that say what they lack."""
    from steerlab.sim.errors import MissingPackage

    files = sorted(path for layer in LAYERS for path in (TOP / layer).rglob("*.py"))
    failed = lacking = 0
    for path in files:
        parts = path.relative_to(TOP).with_suffix("").parts
        name = ".".join(("steerlab", *parts)).removesuffix(".__init__")
        try:
            importlib.import_module(name)
        except MissingPackage:
            lacking += 1
        except Exception:
            failed += 1
            traceback.print_exc()
    sys.stdout.write(f"imported {len(files) - failed - lacking} of {len(files)} modules\n")
    return failed


def run(arguments: list[str]) -> int:
    """The commands one after another, until one fails."""
    from steerlab.app.cli import main

    command: list[str] = []
    for argument in [*arguments, "::"]:
        if argument != "::":
            command.append(argument)
            continue
        if code := main(command):
            return code
        command = []
    return 0


if __name__ == "__main__":
    hide()
    sys.exit(import_all() if sys.argv[1:] == ["import"] else run(sys.argv[1:]))
