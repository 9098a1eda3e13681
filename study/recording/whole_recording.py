"""A recording's file that is there whole or not at all."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from steerlab.sim.files.whole_file import whole_file


@contextmanager
def whole_recording(
    stream: rr.RecordingStream, out: Path, blueprint: rrb.Blueprint
) -> Generator[None]:
    """Have what the block logs written to ``out``; if it raises, ``out`` is as it was.

    Raises:
        OSError, RuntimeError: it cannot be written; the second is what Rerun raises.
    """
    with whole_file(out) as part:
        try:
            stream.save(part, default_blueprint=blueprint)
            yield
            stream.flush()
        finally:
            stream.disconnect()  # also after an error: Windows deletes no file that is open
