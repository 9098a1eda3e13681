"""Files that appear whole or not at all, and survive a power cut."""

import os
from pathlib import Path


def put(part: Path, path: Path) -> None:
    """Give a file its name once the disk has all of it.

    Args:
        part: written and closed, in the folder of ``path``.

    Raises:
        OSError: the disk does not take it.
    """
    with part.open("rb") as file:
        os.fsync(file.fileno())
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
