"""What the system refused, in words: a full disk and too few handles are no wrong path."""

import errno
import os

_MENDS = {
    errno.ENOSPC: "make room on this disk",
    errno.EDQUOT: "delete files of yours there, or ask for a larger quota",
    errno.EFBIG: "allow larger files (ulimit -f), or use a disk that takes them",
    errno.EMFILE: "allow more open files (ulimit -n), such as ulimit -n 1024",
    errno.ENFILE: "close programs: the whole machine has too many open files",
}


def refusal(error: OSError, mend: str = "") -> str:
    """Cause and mend, such as ``No space left on device; make room on this disk``.

    Args:
        mend: what to do about anything but running out, such as ``choose another --out``.
    """
    if (
        error.errno in _MENDS
    ):  # libraries such as pyarrow put words of their own around the system's
        return f"{os.strerror(error.errno)}; {_MENDS[error.errno]}"
    return f"{error.strerror or error}{mend and f'; {mend}'}"


def ran_out(error: OSError) -> bool:
    """Whether it says that there is no more of something: room, or handles."""
    return error.errno in _MENDS
