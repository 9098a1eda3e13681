"""A run that goes on where it was: its folder, its settings, and results that belong together."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from steerlab.sim.files.folder_lock import RUN_LOCK, holder_name, locked
from steerlab.sim.files.output_folder import OutputError, sync_tree
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.shared_folder import entries_of, remove
from steerlab.sim.files.whole_file import sync_folder, whole_file, workspace

SUMMARY = "summary.json"
_LONGEST_DIFFERENCE = 120  # characters; a table of outcomes is not printed


@contextmanager
def run_folder(
    out: Path, settings: Mapping[str, Any], *, file: str, parts: Sequence[str], force: bool
) -> Iterator[None]:
    """Begin a run in ``out``, or go on with the one that is there if it has the same settings.

    No other program runs in ``out`` while the block lasts: two would mix what they keep.

    Args:
        settings: plain values that decide the results; kept in ``file``.
        parts: folders in ``out`` that results go to.
        force: begin anew where ``out`` holds anything else.

    Raises:
        OutputError: ``out`` holds something else, or nothing can be written there.
        LockedOut: another program runs in it.
    """
    wanted = json.loads(json.dumps(settings))
    with ExitStack() as stack:
        try:
            _of_another_run(out, wanted, file, force)  # before a lock is left in what is no run
            out.mkdir(parents=True, exist_ok=True)
            stack.enter_context(locked(out, RUN_LOCK, "works in"))
            for path in _of_another_run(out, wanted, file, force):
                remove(path)
            for part in parts:
                (out / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"Cannot write to {out}: {refusal(error, 'choose another --out')}."
            ) from error
        write_json(wanted, out / file)
        yield


def _of_another_run(out: Path, wanted: dict[str, Any], file: str, force: bool) -> list[Path]:
    """What lies in ``out`` and is of no run with these settings; refused without ``force``."""
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is a file; choose a folder for --out.")
    locks = (RUN_LOCK, holder_name(RUN_LOCK))
    there = [path for path in entries_of(out) if path.name not in locks]
    if not there or _settings(out / file) == wanted:
        return []
    if not force:
        raise OutputError(
            f"{out} holds something else: {_difference(out / file, wanted)}. Choose "
            "another folder, give the same settings to go on, or add --force to begin anew."
        )
    return there


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
    with _can_go_on(path), whole_file(path) as fresh:
        yield fresh


@contextmanager
def results(out: Path) -> Iterator[Path]:
    """Give a folder for all results of a run, ``SUMMARY`` among them, and put them into ``out`` as one.

    The summary in ``out`` stands for all: it goes before the first of the others is replaced, and
    comes after the last. So what lies beside it is of the same call; without it nothing counts.

    Raises:
        OutputError: they cannot be written; what was there is as it was, or has no summary.
    """
    with _can_go_on(out / SUMMARY), workspace(out / SUMMARY) as room:
        fresh = room / "new"
        fresh.mkdir()
        yield fresh
        sync_tree(fresh)
        (out / SUMMARY).unlink(missing_ok=True)
        sync_folder(out)
        files = [path for path in fresh.rglob("*") if path.is_file()]
        for path in sorted(files, key=lambda path: path.name == SUMMARY):  # the summary last
            target = out / path.relative_to(fresh)
            target.parent.mkdir(exist_ok=True)
            path.replace(target)
            sync_folder(target.parent)


@contextmanager
def _can_go_on(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"Cannot write {path}: {refusal(error, 'make the folder writable')}. What was finished "
            "is kept; give the same command again to go on."
        ) from error
