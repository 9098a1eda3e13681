"""A folder of results that is there whole, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from steerlab.sim.errors import SteerlabError


class OutputError(SteerlabError):
    """Results cannot be put where they were asked for."""


@contextmanager
def output_folder(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Give a new folder beside ``path`` to write to, and rename it to ``path`` at the end.

    If the block raises, the new folder is removed and ``path`` is as it was.

    Args:
        force: replace a folder that is not empty.

    Raises:
        OutputError: ``path`` is a file, is not empty, or lies where nothing can be written.
    """
    path = path.absolute()
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file; choose a folder for --out.")
    if path.is_dir() and any(path.iterdir()) and not force:
        raise OutputError(
            f"{path} is not empty; choose another folder, or add --force to replace it."
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{path.name}-", suffix=".part", dir=path.parent))
    except OSError as error:
        raise OutputError(
            f"Cannot write to {path.parent}: {error.strerror or error}; choose another --out."
        ) from error
    try:
        yield fresh
        fresh.chmod(0o755 & ~_umask())
        _put_in_place(fresh, path)
    except OSError as error:
        raise OutputError(
            f"Cannot write results for {path}: {error.strerror or error}; nothing was kept. "
            "Make room, or choose another --out."
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _put_in_place(fresh: Path, path: Path) -> None:
    """The old folder is removed only once the new one is there."""
    if not path.exists():
        fresh.rename(path)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}-", suffix=".old", dir=path.parent))
    try:
        shutil.move(path, old)  # a copy where a layered file system cannot rename a folder
        try:
            fresh.rename(path)
        except OSError:
            shutil.move(old / path.name, path)
            raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
