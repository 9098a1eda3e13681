"""Files that appear whole or not at all, and survive a power cut as far as the system promises it."""

import os
import shutil
import tempfile
from collections.abc import Generator, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from steerlab.sim.files.refusal import ran_out
from steerlab.sim.files.shared_folder import entries_of

_PREFIX, _SUFFIX = ".", ".part"
_OWNER = "owner.lock"
_TRIES = 20  # of workspaces that others took for abandoned before they were locked


@contextmanager
def whole_file(path: Path, placing: AbstractContextManager[None] | None = None) -> Generator[Path]:
    """A file to write and close elsewhere; it becomes ``path`` if the block ends well.

    A reader of ``path`` sees what was there before or all that is new, never half of it. If the
    block raises, ``path`` is as it was. Of several writers at a time the last to finish counts.

    Args:
        placing: held while the file gets its name; may refuse it.

    Raises:
        OSError: the disk does not take it.
    """
    with workspace(path) as room:
        part = room / path.name
        yield part
        with placing or nullcontext():
            rename_durably(part, path)


@contextmanager
def workspace(path: Path) -> Generator[Path]:
    """A hidden folder beside ``path``, in which it can be prepared; removed in the end.

    It is locked as long as the block lasts. What killed programs left of earlier ones for the same
    ``path`` is removed first.

    Raises:
        OSError: nothing can be written there.
    """
    for left in abandoned(path):
        shutil.rmtree(left, ignore_errors=True)
    room, lock = _owned_room(path)
    try:
        yield room
    finally:
        lock.release()
        shutil.rmtree(room, ignore_errors=True)  # Windows deletes no file that is still open


def _owned_room(path: Path) -> tuple[Path, FileLock]:
    """A new folder and its lock, which is held: whoever can lock a workspace may remove it."""
    for left in reversed(range(_TRIES)):
        room = Path(
            tempfile.mkdtemp(prefix=f"{_PREFIX}{path.name}-", suffix=_SUFFIX, dir=path.parent)
        )
        made, lock = room.stat().st_ino, _lock(room)
        try:
            lock.acquire()
        except Timeout:  # somebody is about to remove it
            if not left:
                shutil.rmtree(room, ignore_errors=True)
                raise
        except (OSError, NotImplementedError) as error:  # no locks here: then it is never removed
            if isinstance(error, OSError) and ran_out(error):
                shutil.rmtree(room, ignore_errors=True)
                raise
            if room.is_dir():
                return room, lock
        if lock.is_locked:
            with suppress(FileNotFoundError):
                if room.stat().st_ino == made:
                    return room, lock
            lock.release()
            shutil.rmtree(room, ignore_errors=True)
    raise FileNotFoundError(f"Every workspace beside {path} was removed at once.")


def abandoned(path: Path) -> Iterator[Path]:
    """Workspaces for ``path`` whose owners are gone; each is locked while it is looked at."""
    start = f"{_PREFIX}{path.name}-"
    with suppress(OSError):  # whoever writes there will say it
        for room in sorted(path.parent.iterdir()):
            ours = room.name.startswith(start) and room.name.endswith(_SUFFIX)
            # Further dashes and dots would belong to another file: `.a-b-xyz.part` is of `a-b`.
            unique = room.name[len(start) : -len(_SUFFIX)]
            if not ours or "-" in unique or "." in unique:
                continue
            lock = _lock(room)
            try:
                lock.acquire()
            except (Timeout, OSError, NotImplementedError):
                continue
            try:
                yield room
            finally:
                lock.release()
            if not any(path for path in entries_of(room) if path.name != _OWNER):
                shutil.rmtree(room, ignore_errors=True)  # Windows could not while it was locked


def _lock(room: Path) -> FileLock:
    return FileLock(room / _OWNER, blocking=False, fallback_to_soft=False, thread_local=False)


def rename_durably(part: Path, path: Path) -> None:
    """Give a file its name once the disk has all of it; what had the name is replaced.

    On Linux all of it survives a power cut once this returns. On macOS the drive may still hold it
    in its own cache. On Windows the content is on the disk, but the new name may be lost: see
    ``sync_folder``.

    Args:
        part: written and closed, in the folder of ``path``.

    Raises:
        OSError: the disk does not take it; on Windows also if another program has ``path`` open.
    """
    with part.open("r+b") as file:  # Windows flushes only what is open for writing
        os.fsync(file.fileno())
    part.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the names in ``folder``, so that a power cut does not undo a rename.

    Windows opens no folder, so there is nothing to wait for: a power cut soon after a rename may
    bring the old name back, with what it stood for.

    Raises:
        OSError: the folder cannot be read, or the disk fails.
    """
    if not hasattr(os, "O_DIRECTORY"):  # Windows
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
