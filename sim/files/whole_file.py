"""Files that appear whole or not at all, and survive a power cut as far as the system promises it."""

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Generator[Path]:
    """A file beside ``path`` to write and close; it becomes ``path`` if the block ends well.

    A reader of ``path`` sees what was there before or all that is new, never half of it. If the
    block raises, ``path`` is as it was. One writer at a time: two would write to the same file.

    Raises:
        OSError: the disk does not take it.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        yield part
        rename_durably(part, path)
    except BaseException:
        # Windows deletes no file that is still open. What came first counts, and the next attempt
        # writes over what is left.
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


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
