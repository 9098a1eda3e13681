"""One program at a time: a lock on a study's folder that ends with the program that holds it."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from steerlab.sim.errors import SteerlabError

RUN_LOCK = "run.lock"
"""Held by whatever lets a participant sit at the wheel, or changes what they left."""
CONSOLE_LOCK = "console.lock"
"""Held by the console; a run and a console go together."""


class LockedOut(SteerlabError):
    """Another program holds the lock; ``pid`` is its process, None if it did not say."""

    def __init__(self, message: str, pid: int | None) -> None:
        super().__init__(message)
        self.pid = pid


@dataclass(frozen=True, slots=True)
class FolderLock:
    """Held while the block of ``locked`` lasts; handed on to what would take it as well."""

    folder: Path
    name: str


@contextmanager
def locked(folder: Path, name: str, what: str) -> Generator[FolderLock]:
    """Hold the lock ``name`` of an existing folder.

    The system lets go of it when the process ends, however it ends: a lock of a dead process is
    simply taken over. The process id in the file is for whoever is refused.

    Args:
        what: what the holder does there, such as ``records into``.

    Raises:
        LockedOut: another process holds it.
        OSError: the file cannot be made.
    """
    with (folder / name).open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            said = file.read().strip()
            pid = int(said) if said.isdecimal() else None
            who = f": process {pid}" if pid is not None else ""
            raise LockedOut(
                f"Another program {what} {folder} already{who}. Close it, or wait until it is done.",
                pid,
            ) from None
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield FolderLock(folder, name)
