"""Files made from a study's data: kept only while nobody is erased, and found by content when one is."""

import json
import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from errno import EACCES, EPERM, EROFS
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile, ZipFile

import pyarrow.parquet as pq

from steerlab.sim.files.by_suffix import has_suffix
from steerlab.sim.files.folder_lock import locked
from steerlab.sim.files.shared_folder import entries_of, everything_in
from steerlab.study.contract import StudyError
from steerlab.study.store.people import Departure, read_departures
from steerlab.study.store.store import DATABASE_FILES, STUDY_FILE, StudyStore

DERIVED_LOCK = "derived.lock"
"""Held for a moment by whoever puts derived data in place, and by an erasure that removes them."""
_WAIT_S = 60.0
ERASED_BEFORE = "erased_before"
"""In the ``summary.json`` of results: people whose data were gone when these were made."""

EXPORT_COLUMN = "steerlab_study"
"""The first column of every exported table, by which a file of one is told wherever it lies."""
EXPORT_LABEL = "steerlab export"
"""Begins the file label of an exported SPSS file and the comment of a packed export, and is a key in
the schema of a Parquet file."""
VIDEO_LABEL = "steerlab video of "
"""Begins the comment in a video file of an attempt; the pseudonym follows."""
_CSV_STARTS = tuple(f"{mark}{EXPORT_COLUMN}{mark}".encode() for mark in ("", '"'))
_SPSS_START, _SPSS_LABEL_AT = b"$FL", 109
_LONGEST_HEADER = 10_000_000  # bytes of what is said about a network or a video in its file

_DAMAGED = (
    *(OSError, ValueError, EOFError, BadZipFile, zlib.error, struct.error),
    *(NotImplementedError, RuntimeError),  # a method or a password that no export has
)
"""What reading a damaged archive or Parquet file raises."""

DERIVED = ("exports", "report")
"""Subfolders with nothing but what can be made anew from the database."""


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
        """Read the study, or write what was made of it; an error that comes of an erasure says so.

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
    label tables, Rerun recordings, videos (.mp4), exported tables (.csv, .sav, .parquet) and
    exports that the console packed (.zip); and by name ``DERIVED`` and what a killed program left of them.

    Args:
        known: names in ``folder`` that are kept or removed on other grounds.
    """
    made: list[Path] = []
    for path in sorted(folder.iterdir()):
        if path.name in known or path.name in DATABASE_FILES:
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
        for child in entries_of(path):
            if not child.is_symlink():
                yield from _made_by_us(child)
    elif path.is_file() and _kind(path):
        yield path


def _summary(folder: Path) -> dict[str, Any] | None:
    """The ``summary.json`` of a folder of results; None if it holds none of ours."""
    try:
        return _of_ours((folder / "summary.json").read_bytes())
    except OSError:
        return None


def _of_ours(summary: bytes) -> dict[str, Any] | None:
    try:
        values = json.loads(summary)
    except (ValueError, RecursionError):
        return None
    return values if isinstance(values, dict) and "verb" in values else None


def _packed_summary(path: Path) -> dict[str, Any] | None:
    """The ``summary.json`` of an export that the console packed; None if it is no such .zip."""
    try:
        with ZipFile(path) as packed:
            if not packed.comment.startswith(EXPORT_LABEL.encode()):
                return None  # somebody's own archive, whatever is in it
            names = [name for name in packed.namelist() if name.endswith("/summary.json")]
            return next(filter(None, (_of_ours(packed.read(name)) for name in names)), None)
    except _DAMAGED:
        return None


def _kind(path: Path) -> str | None:
    """What a single file of ours holds; None if it is not ours."""
    try:
        with path.open("rb") as file:
            start = file.read(_SPSS_LABEL_AT + len(EXPORT_LABEL))
            if start.startswith(_CSV_STARTS):
                return "exported table"
            if start.startswith(_SPSS_START):
                is_ours = start[_SPSS_LABEL_AT:] == EXPORT_LABEL.encode()
                return "exported table" if is_ours else None
            if start.startswith(b"PK\x03\x04"):
                return "packed export" if _packed_summary(path) is not None else None
            if start.startswith(b"RRF"):
                return "Rerun recording"
            if _is_mp4(start):
                return "video" if VIDEO_LABEL.encode() in _mp4_header(file) else None
            if start.startswith(b"PAR1"):
                schema = pq.read_schema(path)
                exported = EXPORT_LABEL.encode() in (schema.metadata or {})
                labels = {"participant", "teacher_label"} <= {*schema.names}
                return "labels" if exported or labels else None
            if has_suffix(path, ".safetensors") and len(start) >= 8:
                (length,) = struct.unpack("<Q", start[:8])
                file.seek(8)
                header = file.read(length) if length < _LONGEST_HEADER else b""
                return "network" if b'"steerlab"' in header else None
    except (OSError, ValueError):  # pyarrow's errors are among them
        return None
    return None


def _is_mp4(start: bytes) -> bool:
    return start[4:8] == b"ftyp"


def _mp4_header(file: BinaryIO) -> bytes:
    """The box that says what a video holds (ISO/IEC 14496-12); empty where there is none."""
    at = 0
    while True:
        file.seek(at)
        start = file.read(16)
        size, kind = int.from_bytes(start[:4], "big"), start[4:8]
        if size == 1:  # a box of 4 GiB or more has its size behind its kind
            size = int.from_bytes(start[8:], "big")
        if not 8 <= size < 1 << 62:
            return b""
        if kind == b"moov":
            file.seek(at)
            return file.read(size) if size < _LONGEST_HEADER else b""
        at += size


def left_of(folder: Path, participant: str) -> list[Path]:
    """Files of ours outside the database in which somebody's pseudonym stands, by name or content."""
    named = re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")
    inside = re.compile(named.pattern.encode())
    left: list[Path] = []
    for path in everything_in(folder):
        if not path.is_file() or path.is_symlink() or path.name in DATABASE_FILES:
            continue
        results = [s for parent in _above(path, folder) if (s := _summary(parent)) is not None]
        if _kind(path) == "packed export" and (packed := _packed_summary(path)) is not None:
            results.append(packed)
        if any(participant in summary.get(ERASED_BEFORE, ()) for summary in results):
            continue  # made without the person: it names them among those who are left out
        if (results or _kind(path)) and (
            named.search(path.name) or _holds(path, inside, participant)
        ):
            left += [path] if path.exists() else []  # its maker may have removed it by now
    return left


def _above(path: Path, folder: Path) -> Iterator[Path]:
    for parent in path.parents:
        yield parent
        if parent == folder:
            return


def _holds(path: Path, inside: re.Pattern[bytes], participant: str) -> bool:
    """Whether somebody is in a file of ours; one that cannot be read may hold anybody."""
    try:
        if _kind(path) != "packed export":
            return _mentions(path.read_bytes(), inside, participant)
        with ZipFile(path) as packed:
            return any(
                inside.search(name.encode()) or _mentions(packed.read(name), inside, participant)
                for name in packed.namelist()
            )
    except _DAMAGED:
        return True


def _mentions(content: bytes, inside: re.Pattern[bytes], participant: str) -> bool:
    if content.startswith(b"PAR1"):
        names = pq.read_schema(BytesIO(content)).names
        if "participant" not in names:
            return False
        people = pq.read_table(BytesIO(content), columns=["participant"])["participant"]
        return participant in people.unique().to_pylist()
    if _is_mp4(content):  # of a picture's bytes some may look like a name
        content = _mp4_header(BytesIO(content))
    if content.startswith(_SPSS_START):  # its texts fill eights of bytes, without anything between
        cell = participant.encode().ljust(-(-len(participant) // 8) * 8)
        return cell in content or inside.search(content) is not None
    return inside.search(content) is not None
