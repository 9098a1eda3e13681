"""Markers as streams of Lab Streaming Layer, by the extra ``lsl`` (pylsl); see docs/markers.md."""

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from time import perf_counter_ns, sleep
from typing import TYPE_CHECKING
from uuid import uuid4

from steerlab.sim.errors import MissingPackage
from steerlab.study.recording.writer import WriterThread
from steerlab.study.store.store import STUDY_FILE, StudyStore

if TYPE_CHECKING:
    from pylsl import StreamOutlet

MARKERS, STEPS = "steerlab markers", "steerlab steps"
"""Names of the streams."""
_TYPES = {MARKERS: "Markers", STEPS: "ControlSteps"}
_LINGER_S = 0.5  # for who listens: what was pushed last is sent by a thread of the library's

_log = logging.getLogger(__name__)


class LslMarkers:
    """Two streams on the local network; a thread of its own pushes, and the loop never waits.

    Args:
        source: identifies the streams: of equal ones a recorder that lost one finds it again.

    Raises:
        MissingPackage: pylsl or its library is not installed.
    """

    def __init__(self, source: str) -> None:
        check_installed()
        from pylsl import cf_double64, cf_string, local_clock

        self._clock: Callable[[], float] = local_clock
        self._markers = _outlet(MARKERS, ("marker",), cf_string, source)
        self._steps = _outlet(STEPS, ("order", "step"), cf_double64, f"{source}-steps")
        self._failed = False
        self._thread = WriterThread()

    def mark(self, what: str, at_ns: int, /, **details: str | int | float) -> None:
        """Hand over a marker; returns at once."""
        self._thread.tell((self._push_marker, {"mark": what, **details}, at_ns))

    def step(self, order: int, step: int, at_ns: int) -> None:
        """Hand over a control step; returns at once."""
        self._thread.tell((self._push_step, (float(order), float(step)), at_ns))

    def close(self) -> None:
        """Send what was handed over and end the streams; calling it again does nothing."""
        self._thread.stop()
        if self._markers.have_consumers() or self._steps.have_consumers():
            sleep(_LINGER_S)

    # In the thread, in which nothing may be raised.

    def _push_marker(self, marker: dict[str, str | int | float], at_ns: int) -> None:
        self._push(self._markers, [json.dumps(marker)], at_ns)

    def _push_step(self, step: tuple[float, float], at_ns: int) -> None:
        self._push(self._steps, list(step), at_ns)

    def _push(self, outlet: "StreamOutlet", sample: list[str] | list[float], at_ns: int) -> None:
        if self._failed:
            return
        try:
            # The clocks may differ and drift, so they are compared anew each time.
            outlet.push_sample(sample, self._clock() - (perf_counter_ns() - at_ns) / 1e9)
        except Exception as error:  # of the library's: the drive and its record matter more
            self._failed = True
            _log.warning("Markers are no longer sent: %s. The drive is recorded as ever.", error)


@contextmanager
def lsl_markers(source: str | None) -> Iterator[LslMarkers | None]:
    """The streams while the block lasts; None for none.

    Raises:
        MissingPackage: pylsl or its library is not installed.
    """
    if source is None:
        yield None
        return
    markers = LslMarkers(source)
    try:
        yield markers
    finally:
        markers.close()


def study_source(folder: Path) -> str:
    """What identifies a study's streams: its audit's first hash; of a new study anything.

    Raises:
        StoreError: the study cannot be read.
    """
    first: list[tuple[str]] = []
    if (folder / STUDY_FILE).exists():
        with StudyStore.open(folder / STUDY_FILE, read_only=True) as store:
            first = store.connection.read("SELECT sha256 FROM audit ORDER BY id LIMIT 1")
    return f"steerlab-{first[0][0][:16]}" if first else new_source()


def new_source() -> str:
    """What identifies streams that belong to no study yet."""
    return f"steerlab-{uuid4().hex[:16]}"


def check_installed() -> None:
    """Refuse before anything is begun.

    Raises:
        MissingPackage: with how to install it.
    """
    try:
        import pylsl  # noqa: F401
    except ImportError as error:
        raise MissingPackage(
            "Markers for Lab Streaming Layer need pylsl, which is not installed; run pip install "
            "'steerlab[lsl]', or leave out --lsl."
        ) from error
    except (RuntimeError, OSError) as error:  # pylsl's own, where it finds no liblsl
        raise MissingPackage(
            "Markers for Lab Streaming Layer need the library liblsl, which pylsl does not bring "
            "for this system and did not find; install liblsl and name its file in PYLSL_LIB, or "
            "leave out --lsl."
        ) from error


def _outlet(name: str, channels: tuple[str, ...], kind: int, source: str) -> "StreamOutlet":
    from pylsl import IRREGULAR_RATE, StreamInfo, StreamOutlet

    info = StreamInfo(name, _TYPES[name], len(channels), IRREGULAR_RATE, kind, source)
    info.desc().append_child_value("steerlab_version", version("steerlab"))
    labels = info.desc().append_child("channels")
    for channel in channels:
        labels.append_child("channel").append_child_value("label", channel)
    return StreamOutlet(info)
