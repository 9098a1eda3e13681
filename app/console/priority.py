"""The console gives way to the drive: a flood of requests must not make the wheel late."""

import os
import sys

NICENESS = 10  # a tenth of the processor that a drive gets where both want it


def give_way() -> None:
    """Lower the priority of this thread, and of those that it starts from now on.

    Only on Linux, where each thread has its own: elsewhere the drive, which this program starts,
    would be lowered with it.
    """
    if sys.platform == "linux" and hasattr(os, "nice"):
        os.nice(NICENESS)
