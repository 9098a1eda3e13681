"""Programs that are started here and are not meant by Ctrl+C in the terminal."""

import subprocess
from typing import TypedDict


class Apart(TypedDict, total=False):
    """Arguments of ``subprocess.Popen``."""

    start_new_session: bool
    creationflags: int


def apart_from_terminal() -> Apart:
    """What ``subprocess.Popen`` is told: a session of its own, on Windows a process group."""
    new_group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", None)  # Windows alone has it
    return {"start_new_session": True} if new_group is None else {"creationflags": new_group}
