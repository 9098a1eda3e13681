"""Files of a run that goes on where it was: each is written whole or not at all."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from safetensors import SafetensorError

from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.whole_file import whole_file


def write_json(values: object, path: Path, *, indent: int | None = 1) -> None:
    """Write plain values; see ``write_text``."""
    write_text(json.dumps(values, ensure_ascii=False, allow_nan=False, indent=indent) + "\n", path)


def write_text(text: str, path: Path) -> None:
    """Write UTF-8, whole or not at all: a reader never sees half a file.

    Raises:
        OutputError: there is no room, or nothing may be written; what was finished is kept.
    """
    with keeping(path) as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n")


@contextmanager
def keeping(path: Path) -> Iterator[Path]:
    """``whole_file`` for a run that can be gone on with.

    Raises:
        OutputError: it cannot be written; ``path`` is as it was.
    """
    try:
        with whole_file(path) as fresh:
            yield fresh
    except (OSError, SafetensorError) as error:
        why = getattr(error, "strerror", None) or error
        raise OutputError(
            f"Cannot write {path}: {why}. What was finished is kept; make room and give the same "
            "command again to go on."
        ) from error
