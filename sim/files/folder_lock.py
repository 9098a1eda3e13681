"""One program at a time: a lock on a study's folder that ends with the program that holds it."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from steerlab.sim.errors import SteerlabError

RUN_LOCK = "run.lock"
"""Held by whatever lets a participant sit at the wheel, or changes what they left."""
CONSOLE_LOCK = "console.lock"
"""Held by the console; a run and a console go together."""


class LockedOut(SteerlabError):
    """Another program holds the lock.

    Attributes:
        pid: its process; None if it did not say.
        about: whom it is at work for, as it said; empty if it did not.
    """

    def __init__(self, message: str, pid: int | None, about: str = "") -> None:
        super().__init__(message)
        self.pid = pid
        self.about = about


@dataclass(frozen=True, slots=True)
class FolderLock:
    """Held while the block of ``locked`` lasts; handed on to what would take it as well."""

    folder: Path
    name: str


@contextmanager
def locked(
    folder: Path, name: str, what: str, *, about: str = "", wait_s: float = 0.0
) -> Generator[FolderLock]:
    """Hold the lock ``name`` of an existing folder; taken twice in one process it is refused too.

    The system lets go of it when the process ends, however it ends: a lock of a dead process is
    simply taken over. The process id in the file beside it is for whoever is refused.

    Args:
        what: what the holder does there, such as ``records into``.
        about: a pseudonym, said to whoever is refused.
        wait_s: how long to wait for another holder.

    Raises:
        LockedOut: another process holds it, or this one.
        OSError: there is no such folder, the file cannot be made, or its file system has no locks.
    """
    folder.stat()  # FileLock would make a folder that is missing
    # Without fallback_to_soft=False a file system that has no locks would get a file that outlives
    # a crash. A context of the thread's own could not be left in another one, as an ExitStack may.
    lock = FileLock(folder / name, timeout=wait_s, fallback_to_soft=False, thread_local=False)
    holder = folder / holder_name(name)
    try:
        lock.acquire()
    except Timeout:
        pid, whom = _said(holder)
        who = f": process {pid}" if pid is not None else ""
        raise LockedOut(
            f"Another program {what} {folder} already{who}. Close it, or wait until it is done.",
            pid,
            whom,
        ) from None
    try:
        holder.write_text(f"{os.getpid()} {about}".strip() + "\n", encoding="utf-8")
        yield FolderLock(folder, name)
    finally:
        lock.release()


def holder_name(name: str) -> str:
    """The file beside a lock in which its holder leaves its process id: ``run.pid``.

    Not the lock's own file, which nobody else can read on Windows while it is locked.
    """
    return f"{name.removesuffix('.lock')}.pid"


def _said(holder: Path) -> tuple[int | None, str]:
    """The holder's process id, and whom it is at work for."""
    try:
        pid, _, about = holder.read_text(encoding="utf-8").strip().partition(" ")
    except FileNotFoundError:  # it has only just taken the lock
        return None, ""
    return (int(pid) if pid.isdecimal() else None), about
