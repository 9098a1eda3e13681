"""What a process of its own writes, kept for whoever wants its last lines."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from threading import Lock


class RunOutput:
    """A file that outlives the console, which a pipe would not: the process writes on into it.

    It has no name, so nothing is left of it when both are gone. Windows takes no name from a file
    that is open: there it keeps one in the folder for temporary files until ``close``, and beyond
    that if the process still writes or the console was killed.

    Attributes:
        sink: for the process's stdout; ``handed_over`` closes it here.
    """

    def __init__(self) -> None:
        handle, name = tempfile.mkstemp(prefix="steerlab-run-")
        self._path = Path(name)
        self.sink = os.fdopen(handle, "wb")
        self._reading = self._path.open("rb")  # with a place of its own, which is not the process's
        self._lock = Lock()
        self._forget_name()

    def handed_over(self) -> None:
        """The process has the sink."""
        self.sink.close()

    def tail(self, most: int) -> bytes:
        """The last ``most`` bytes so far."""
        with self._lock:
            size = self._reading.seek(0, os.SEEK_END)
            self._reading.seek(max(0, size - most))
            return self._reading.read(most)

    def close(self) -> None:
        """Read no more; the process may go on writing."""
        self.sink.close()
        self._reading.close()
        self._forget_name()

    def _forget_name(self) -> None:
        with suppress(PermissionError):  # Windows, while it is open
            self._path.unlink(missing_ok=True)
