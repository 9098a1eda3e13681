"""A folder of results that is there whole, or not at all; and whether it could be, before the work."""

import ctypes
import errno
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import abandoned, sync_folder, workspace

_NEW, _OLD = "new", "old"
_AT_FDCWD, _EXCHANGE = -100, 2  # linux/fcntl.h, linux/fs.h; 2 is RENAME_SWAP of macOS too
_UNMOVABLE = (errno.EACCES, errno.EPERM, errno.EBUSY, errno.EROFS)


class OutputError(SteerlabError):
    """Results cannot be put where they were asked for."""


@contextmanager
def output_folder(
    path: Path, *, force: bool = False, placing: AbstractContextManager[None] | None = None
) -> Iterator[Path]:
    """Give a new folder to write to, and put it in place of ``path`` at the end.

    If the block raises, ``path`` is as it was. A program that is killed leaves the old folder or
    the new one under this name; on systems that cannot exchange two names at once the old one may
    be hidden until the next call, which brings it back.

    Args:
        path: a link to a folder stands for that folder.
        force: replace a folder that is not empty.
        placing: held while the folder is put in place; may refuse it.

    Raises:
        OutputError: ``path`` is a file, is not empty, is the folder that the program was started
            in, or lies where nothing can be written.
    """
    check_output_folder(path, force=force)
    path = Path(os.path.realpath(path))
    try:
        with workspace(path) as room:
            fresh = room / _NEW
            fresh.mkdir()
            yield fresh
            sync_tree(fresh)
            with placing or nullcontext():
                _refuse_what_is_there(path, force, room)  # of another program meanwhile
                _put_in_place(room, path)
    except OSError as error:
        raise OutputError(
            f"Cannot write results for {path}: {refusal(error, 'choose another folder')}. Nothing was "
            "kept; what was there is as it was."
        ) from error


def check_output_folder(path: Path, *, force: bool = False) -> None:
    """Find out whether ``output_folder`` could put results at ``path``, before they are made.

    Raises:
        OutputError: as of ``output_folder``.
    """
    path = Path(os.path.realpath(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in abandoned(path):
            _finish(left, path)
        with workspace(path) as room:
            _refuse_what_is_there(path, force, room)
    except OSError as error:
        raise OutputError(
            f"Cannot write to {path.parent}: {refusal(error, 'choose another folder')}."
        ) from error


def check_output_file(path: Path) -> None:
    """Find out whether a file could be put at ``path``, before it is made.

    Raises:
        OutputError: it could not.
    """
    try:
        if path.is_dir():
            raise OutputError(f"{path} is a folder; give the name of a file.")
        path.parent.mkdir(parents=True, exist_ok=True)
        with workspace(path) as room:
            _refuse_unmovable(path, room)
    except OSError as error:
        raise OutputError(
            f"Cannot write {path}: {refusal(error, 'choose another file')}."
        ) from error


def _refuse_what_is_there(path: Path, force: bool, room: Path) -> None:
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file; choose a folder.")
    if path.is_dir() and Path.cwd().is_relative_to(path):
        raise OutputError(
            f"{path} is the folder you are in, or holds it, and would be replaced as a whole; "
            "choose a new folder inside it."
        )
    if path.is_dir() and any(path.iterdir()) and not force:
        raise OutputError(
            f"{path} is not empty; choose another folder, or add --force to replace it."
        )
    _refuse_unmovable(path, room)


def _refuse_unmovable(path: Path, room: Path) -> None:
    """Refuse what cannot be replaced: where a disk is mounted, or what belongs to somebody else.

    Asked by renaming it onto a folder that is not empty: that is never done, but says why else not.
    """
    full = room / "full"
    (full / "of something").mkdir(parents=True, exist_ok=True)
    try:
        path.rename(full)
    except OSError as error:
        if error.errno in _UNMOVABLE:
            raise OutputError(
                f"{path} cannot be replaced: {error.strerror}. It belongs to somebody else, or a "
                "disk is mounted there; choose a new name beside it or inside it."
            ) from error
    else:
        full.rename(path)  # a file system that cares for no rules


def sync_tree(folder: Path) -> None:
    """Wait until the disk has all that is in ``folder``."""
    for parent, _, names in os.walk(folder):
        for name in names:
            with open(Path(parent, name), "r+b") as file:
                os.fsync(file.fileno())
        sync_folder(Path(parent))


def _put_in_place(room: Path, path: Path) -> None:
    fresh = room / _NEW
    if not path.exists():
        fresh.rename(path)
    elif not exchange(fresh, path):
        _set_aside(path, room)
        try:
            fresh.rename(path)
        except OSError:
            (room / _OLD).rename(path)
            raise
    sync_folder(path.parent)


def _set_aside(path: Path, room: Path) -> None:
    """Move ``path`` to ``room/old``, which is there only when it is whole."""
    try:
        path.rename(room / _OLD)
    except OSError as error:  # a layered file system cannot rename a folder of a lower layer
        if error.errno != errno.EXDEV:
            raise
        shutil.copytree(path, room / "copy", symlinks=True)
        (room / "copy").rename(room / _OLD)
        shutil.rmtree(path)


def _finish(room: Path, path: Path) -> None:
    """Undo what a killed program had begun: the old folder comes back if the new one never came."""
    if (room / _OLD).is_dir() and (room / _NEW).is_dir():
        if path.exists():  # half removed after it was copied
            shutil.rmtree(path)
        (room / _OLD).rename(path)
    shutil.rmtree(room, ignore_errors=True)


def exchange(first: Path, second: Path) -> bool:
    """Let two paths of one file system swap their names at once; False where that is not known."""
    names = os.fsencode(first), os.fsencode(second)
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            return libc.renamex_np(*names, _EXCHANGE) == 0
        return libc.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _EXCHANGE) == 0
    except (OSError, AttributeError, TypeError):  # no such call; Windows has no CDLL(None)
        return False
