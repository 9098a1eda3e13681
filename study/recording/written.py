"""Whether Rerun wrote all of a recording: it tells its own log alone where it did not."""

import os
from pathlib import Path

from steerlab.sim.files.writing import why_not_written

_END, _COUNT = b"RRF2FOOT", 4  # what a file of Rerun 0.41 ends with, and bytes after it


def check_written(path: Path) -> None:
    """Refuse a recording that was closed and lacks its end.

    Raises:
        OSError: it does, or cannot be read; says why if the system still refuses to write it.
    """
    with path.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - len(_END) - _COUNT))
        if not file.read().startswith(_END):
            raise why_not_written(path, "Rerun did not write its end")
