"""A run that goes on where it was: its folder, its settings, and files that are there whole or not."""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.whole_file import whole_file

_LONGEST_DIFFERENCE = 120  # characters; a table of outcomes is not printed


def open_run_folder(
    out: Path, settings: Mapping[str, Any], *, file: str, parts: Sequence[str], force: bool
) -> None:
    """Begin a run in ``out``, or go on with the one that is there if it has the same settings.

    Args:
        settings: plain values that decide the results; kept in ``file``.
        parts: folders in ``out`` that results go to.
        force: begin anew where ``out`` holds anything else.

    Raises:
        OutputError: ``out`` holds something else, or nothing can be written there.
    """
    wanted = json.loads(json.dumps(settings))
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file; choose a folder for --out.")
        if out.is_dir() and any(out.iterdir()) and _settings(out / file) != wanted:
            if not force:
                raise OutputError(
                    f"{out} holds something else: {_difference(out / file, wanted)}. Choose "
                    "another folder, give the same settings to go on, or add --force to begin anew."
                )
            shutil.rmtree(out)
        for part in parts:
            (out / part).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"Cannot write to {out}: {error.strerror or error}; choose another --out."
        ) from error
    write_json(wanted, out / file)


def _settings(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _difference(path: Path, wanted: dict[str, Any]) -> str:
    kept = _settings(path)
    if not isinstance(kept, dict):
        return f"it has no readable {path.name}"
    changes: list[str] = []
    for name in {**wanted, **kept}:
        if kept.get(name) != wanted.get(name):
            said = f"{name} was {kept.get(name)} and is now {wanted.get(name)}"
            changes.append(said if len(said) < _LONGEST_DIFFERENCE else f"{name} is another")
    return "; ".join(changes)


def write_json(values: object, path: Path, *, indent: int | None = 1) -> None:
    """Write plain values; see ``write_text``.

    Raises:
        OutputError: also if a figure is NaN or infinite: such a run is no success.
    """
    write_text(finite_json(values, path.name, indent=indent) + "\n", path)


def finite_json(values: object, name: str, *, indent: int | None = 1) -> str:
    """JSON of plain values, ``name`` being the file that they are for.

    Raises:
        OutputError: a figure is NaN or infinite: such a run is no success.
    """
    try:
        return json.dumps(values, ensure_ascii=False, allow_nan=False, indent=indent)
    except ValueError as error:
        raise OutputError(
            f"{name} would hold a figure that is NaN or infinite ({error}), so the run is no "
            "success; look for labels of absurd size, or a training that diverged."
        ) from error


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
