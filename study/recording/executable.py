"""Where the Rerun viewer is: beside the library, whether or not that folder is on the PATH."""

import os
import shutil
from importlib.util import find_spec
from pathlib import Path

from steerlab.study.recording.errors import RecordingUnavailable

EXECUTABLE = "STEERLAB_RERUN"  # environment variable: another viewer than the installed one


def rerun_executable() -> Path:
    """The viewer's program.

    Raises:
        RecordingUnavailable: there is none; says how to get it.
    """
    chosen = os.environ.get(EXECUTABLE)
    spec = find_spec("rerun_cli")
    beside = (
        [Path(spec.origin).parent / name for name in ("rerun", "rerun.exe")]
        if (spec is not None and spec.origin is not None)
        else []
    )
    on_path = shutil.which("rerun")
    for candidate in [Path(chosen)] if chosen else [*beside, *([Path(on_path)] if on_path else [])]:
        if candidate.is_file():
            return candidate
    where = f"{EXECUTABLE} is {chosen!r}, which is no file" if chosen else "it is not installed"
    raise RecordingUnavailable(
        f"The Rerun viewer cannot be started: {where}. Install it with pip install rerun-sdk."
    )
