"""Files made from a study's data: kept only while nobody is erased, and found by content when one is."""

import json
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from errno import EACCES, EPERM, EROFS
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from steerlab.sim.files.folder_lock import locked
from steerlab.study.contract import StudyError
from steerlab.study.store.people import Departure, read_departures
from steerlab.study.store.store import STUDY_FILE, StudyStore

DERIVED_LOCK = "derived.lock"
"""Held for a moment by whoever puts derived data in place, and by an erasure that removes them."""
_WAIT_S = 60.0
ERASED_BEFORE = "erased_before"
"""In the ``summary.json`` of results: people whose data were gone when these were made."""

DERIVED = ("exports", "report")
"""Subfolders with nothing but what can be made anew from the database."""
_DATABASE = (STUDY_FILE, f"{STUDY_FILE}-wal", f"{STUDY_FILE}-shm")


class ErasedMeanwhile(StudyError):
    """Somebody's data were erased while something was made from them; it is not kept."""


@dataclass(frozen=True)
class ErasureGuard:
    """Made before a study is read: lets through what is derived from it only while nobody is erased.

    Attributes:
        erased: whose data were gone, or on their way out, before.
    """

    folder: Path
    erased: frozenset[str]

    @classmethod
    def of(cls, folder: Path) -> "ErasureGuard":
        """For the study in ``folder`` as it is now.

        Raises:
            StoreError: there is none, or it cannot be read.
        """
        return cls(folder, _erased(folder))

    @contextmanager
    def placing(self) -> Iterator[None]:
        """Put finished files in place in this block; an erasure waits for its end, and then sees them.

        Raises:
            ErasedMeanwhile: somebody has been erased since; nothing may be kept.
            LockedOut: another program holds the lock for a minute.
        """
        with ExitStack() as stack:
            try:
                stack.enter_context(derived_lock(self.folder))
            except OSError as error:
                if error.errno not in (EACCES, EPERM, EROFS):
                    raise  # else it is read-only for us: nothing is put into it, but elsewhere
            self._check()
            yield

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read the study in this block; an error that comes of an erasure meanwhile says so.

        Raises:
            ErasedMeanwhile: in place of the block's own error.
        """
        try:
            yield
        except Exception:
            self._check()
            raise

    def _check(self) -> None:
        if gone := sorted(_erased(self.folder) - self.erased):
            raise ErasedMeanwhile(
                f"The data of {', '.join(gone)} were erased while this ran, so nothing that was "
                "made from them is kept. Give the same command again."
            )


@contextmanager
def derived_lock(folder: Path) -> Iterator[None]:
    """Nothing derived is put in place, or removed, by others in this block.

    Raises:
        LockedOut: another program holds the lock for a minute.
    """
    with locked(folder, DERIVED_LOCK, "puts files in place in", wait_s=_WAIT_S):
        yield


def _erased(folder: Path) -> frozenset[str]:
    with StudyStore.open(folder / STUDY_FILE, read_only=True) as store:
        departures = read_departures(store.connection)
    return frozenset(who for who, how in departures.items() if how is not Departure.KEPT)


def derived_files(folder: Path, known: Sequence[str]) -> list[Path]:
    """Files and folders in a study's folder that steerlab made from its data, wherever they lie.

    Told by content: results with a ``summary.json`` that names its verb, networks and policies,
    label tables and Rerun recordings; and by name ``DERIVED`` and what a killed program left of them.

    Args:
        known: names in ``folder`` that are kept or removed on other grounds.
    """
    made: list[Path] = []
    for path in sorted(folder.iterdir()):
        if path.name in known or path.name in _DATABASE:
            continue
        hidden = path.name.startswith(tuple(f".{name}-" for name in DERIVED))
        if path.name in DERIVED or hidden:
            made.append(path)
        elif not path.is_symlink():
            made += _made_by_us(path)
    return made


def _made_by_us(path: Path) -> Iterator[Path]:
    if path.is_dir():
        if _summary(path) is not None or (path.name.startswith(".") and path.suffix == ".part"):
            yield path
            return
        for child in sorted(path.iterdir()):
            if not child.is_symlink():
                yield from _made_by_us(child)
    elif path.is_file() and _kind(path):
        yield path


def _summary(folder: Path) -> dict[str, Any] | None:
    """The ``summary.json`` of a folder of results; None if it holds none of ours."""
    try:
        values = json.loads((folder / "summary.json").read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return values if isinstance(values, dict) and "verb" in values else None


def _kind(path: Path) -> str | None:
    """What a single file of ours holds; None if it is not ours."""
    try:
        with path.open("rb") as file:
            start = file.read(8)
            if start.startswith(b"RRF"):
                return "Rerun recording"
            if start.startswith(b"PAR1"):
                names = pq.read_schema(path).names
                return "labels" if {"participant", "teacher_label"} <= {*names} else None
            if path.suffix == ".safetensors" and len(start) == 8:
                (length,) = struct.unpack("<Q", start)
                header = file.read(length) if length < 10_000_000 else b""
                return "network" if b'"steerlab"' in header else None
    except (OSError, ValueError):  # pyarrow's errors are among them
        return None
    return None


def left_of(folder: Path, participant: str) -> list[Path]:
    """Files of ours outside the database in which somebody's pseudonym stands, by name or content."""
    named = re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")
    inside = re.compile(named.pattern.encode())
    left: list[Path] = []
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or path.is_symlink() or path.name in _DATABASE:
            continue
        results = [s for parent in _above(path, folder) if (s := _summary(parent)) is not None]
        if any(participant in summary.get(ERASED_BEFORE, ()) for summary in results):
            continue  # made without the person: it names them among those who are left out
        if (results or _kind(path)) and (
            named.search(path.name) or _holds(path, inside, participant)
        ):
            left.append(path)
    return left


def _above(path: Path, folder: Path) -> Iterator[Path]:
    for parent in path.parents:
        yield parent
        if parent == folder:
            return


def _holds(path: Path, inside: re.Pattern[bytes], participant: str) -> bool:
    if _kind(path) == "labels":
        people = pq.read_table(path, columns=["participant"])["participant"]
        return participant in people.unique().to_pylist()
    return inside.search(path.read_bytes()) is not None
