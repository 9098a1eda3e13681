"""Looking through a folder, and removing from it, while other programs write into it and remove."""

import os
import shutil
from collections.abc import Iterator
from errno import EEXIST, EISDIR, ENOENT, ENOTDIR, ENOTEMPTY
from pathlib import Path
from time import sleep

_TRIES, _PAUSE_S = 20, 0.05
_OTHERS_ARE_AT_IT = (
    ENOENT,
    ENOTEMPTY,
    EEXIST,
    EISDIR,
    ENOTDIR,
)  # gone, filled, or of another kind by now


def entries_of(folder: Path) -> list[Path]:
    """What lies in a folder, by name; nothing if it is gone by then.

    Raises:
        OSError: it cannot be read.
    """
    try:
        return sorted(folder.iterdir())
    except FileNotFoundError:
        return []


def everything_in(folder: Path) -> Iterator[Path]:
    """Files and folders below ``folder``, a folder before what is in it; links are not followed.

    Raises:
        OSError: one cannot be read; not if it is gone by then.
    """
    for parent, folders, files in os.walk(folder, onerror=_unless_gone):
        folders.sort()
        yield from (Path(parent, name) for name in sorted([*folders, *files]))


def _unless_gone(error: OSError) -> None:
    if error.errno != ENOENT:
        raise error


def remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; what is gone by then is as wanted.

    Tries again where others add to the folder, or remove from it, at the same time.

    Raises:
        OSError: it cannot be removed.
    """
    for left in reversed(range(_TRIES)):
        try:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
            return
        except OSError as error:
            if error.errno not in _OTHERS_ARE_AT_IT or not left:
                raise
        sleep(_PAUSE_S)
