"""Whether Rerun wrote all of a recording: it tells its own log alone where it did not."""

import os
from pathlib import Path

_END, _COUNT = b"RRF2FOOT", 4  # what a file of Rerun 0.41 ends with, and bytes after it
_FURTHER = bytes(1 << 16)


def check_written(path: Path) -> None:
    """Refuse a recording that was closed and lacks its end.

    Raises:
        OSError: it does, or cannot be read; says why if the system still refuses to write it.
    """
    with path.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - len(_END) - _COUNT))
        if not file.read().startswith(_END):
            raise why_not_written(path, "Rerun did not write its end")


def why_not_written(path: Path, otherwise: str) -> OSError:
    """What the system says to further bytes in a file that is of no use any more.

    Args:
        otherwise: the cause, if the system takes them by now.
    """
    try:
        with path.open("ab") as file:
            file.write(_FURTHER)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return error
    return OSError(otherwise)
