"""Whatever a library raises while it writes a file becomes what the system says of it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FURTHER = bytes(1 << 16)


@contextmanager
def writing(path: Path, *errors: type[Exception]) -> Iterator[None]:
    """Write ``path`` in this block with a library whose ``errors`` do not say what the system said.

    Raises:
        OSError: also for one of ``errors``.
    """
    try:
        yield
    except errors as error:
        raise why_not_written(path, f"{error}".rstrip(".")) from error


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
