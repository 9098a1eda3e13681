"""Rerun recordings made from the study store alone, with the camera's pictures if wanted."""

import subprocess
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import NDArray
from PIL import Image

from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import rename_durably, whole_file, workspace
from steerlab.sim.files.writing import why_not_written
from steerlab.sim.geometry import Pose2D
from steerlab.sim.progress import Progress
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec
from steerlab.study.derived import ErasureGuard
from steerlab.study.recording import layout
from steerlab.study.recording.drive_log import DriveLog
from steerlab.study.recording.scene import log_end, log_world
from steerlab.study.recording.viewer import RecordingUnavailable, rerun_executable
from steerlab.study.recording.written import check_written
from steerlab.study.store.records import Attempt, AttemptData, StoredRollout
from steerlab.study.store.store import STUDY_FILE, StudyStore

PICTURES_HZ = 10.0  # enough to follow by eye; 14 MB a minute at 20 Hz and full size
JPEG_QUALITY = 75
OraclePath = Callable[[WorldSpec, Pose2D], FloatArray | None]
"""Gives the oracle's path from a pose, (points, 2); None where there is none."""


class View(Protocol):
    """Draws a world with the car anywhere in it, such as ``steerlab.sim.engine.world_view``."""

    def frame(self, pose: Pose2D, road_wheel_rad: float = 0.0) -> NDArray[np.uint8]:
        """(height, width, 3) RGB, top row first."""
        ...


OpenView = Callable[[WorldSpec], AbstractContextManager[View]]
"""Prepares to draw a world: slow, and it holds an OpenGL context until it is closed."""


def recording_file(participant: str, rollout: str, attempt: int) -> str:
    """Name of an attempt's file; pseudonyms are escaped, so that no two attempts share a name."""
    person = quote(participant, safe=" ").replace("-", "%2D")
    return f"{person}-{quote(rollout, safe=' ')}-{attempt}.rrd"


def new_stream(rollout: StoredRollout, participant: str, attempt: int) -> rr.RecordingStream:
    """A stream for one attempt, connected to nothing yet.

    All attempts at a rollout belong to one Rerun application, since Rerun keeps a layout for each.
    """
    # Rerun keeps two threads of each stream that nobody has any more until this is called.
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
    return timeless_stream(f"steerlab {rollout.name}", f"{participant}/{rollout.name}/{attempt}")


def timeless_stream(application: str, recording_id: str) -> rr.RecordingStream:
    """A stream that says nothing of when it is written: the same content gives the same file."""
    stream = rr.RecordingStream(application, recording_id=recording_id, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def collect_stream(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> rr.MemoryRecording:
    """Keep what is logged to ``stream``, and its layout, to be written by ``drain_as_bytes``.

    Not by ``stream.save``: once a write of it has failed, the stream may wait for ever for its end,
    and may take half a file for a whole one.
    """
    memory = stream.memory_recording()
    with _layout_of(stream, blueprint) as layout_:
        rerun_bindings.send_blueprint(
            layout_, make_active=False, make_default=True, recording=stream.to_native()
        )
    return memory


def connect_stream(stream: rr.RecordingStream, url: str, blueprint: rrb.Blueprint) -> None:
    """``stream.connect_grpc`` with a layout, without two threads that Rerun 0.41 then leaves."""
    with _layout_of(stream, blueprint) as layout_:
        rerun_bindings.connect_grpc(
            url=url, default_blueprint=layout_, recording=stream.to_native()
        )


@contextmanager
def _layout_of(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> Generator[Any]:
    """A layout as Rerun's own code takes it, in a stream that is closed again.

    Rerun makes such a stream itself, holds it by the memory that it writes to, and so never
    closes it; this needs the same calls, which are not public: hence the pinned version.
    """
    held = rr.RecordingStream._from_native(
        rerun_bindings.new_blueprint(
            application_id=str(stream.get_application_id()),
            make_default=False,
            make_thread_default=False,
            default_enabled=True,
        )
    )
    held.set_time("blueprint", sequence=0)
    blueprint.to_blueprint()._log_to_stream(held)
    memory = held.memory_recording()
    try:
        yield memory.storage
    finally:
        held.disconnect()


def open_study(folder: Path) -> StudyStore:
    """The store of a study folder, to be read; the path of its ``study.db`` serves as well.

    Raises:
        RecordingUnavailable: there is none.
        StoreError: it cannot be read.
    """
    file = folder if folder.name == STUDY_FILE and folder.is_file() else folder / STUDY_FILE
    if not file.is_file():
        raise RecordingUnavailable(
            f"There is no {STUDY_FILE} in {folder}; give the folder of a study, where "
            f"{STUDY_FILE} lies."
        )
    return StudyStore.open(file, read_only=True)


def choose(
    store: StudyStore,
    *,
    participant: str | None = None,
    rollout: str | None = None,
    attempt: int | None = None,
) -> list[Attempt]:
    """Attempts that have steps, in the order in which they were made; None stands for any.

    Raises:
        RecordingUnavailable: there is none; says what there is instead.
    """
    kept = store.attempts()
    if not kept:
        raise RecordingUnavailable(f"{store.path} holds no attempt yet; record a drive first.")
    for what, wanted in (("participant", participant), ("rollout", rollout), ("attempt", attempt)):
        if wanted is None:
            continue
        known = list(dict.fromkeys(getattr(a, what) for a in kept))
        kept = [a for a in kept if getattr(a, what) == wanted]
        if not kept:
            raise RecordingUnavailable(
                f"No {what} {wanted!r} in {store.path}; choose from {known}."
            )
    chosen = [a for a in kept if store.steps(a).num_rows]
    if not chosen:
        raise RecordingUnavailable(
            f"No step was recorded in {', '.join(map(str, kept))}; there is nothing to show."
        )
    return chosen


def rebuild_recording(
    folder: Path,
    out: Path,
    *,
    participant: str | None = None,
    rollout: str | None = None,
    attempt: int | None = None,
    open_view: OpenView | None = None,
    oracle_path: OraclePath | None = None,
    last_only: bool = False,
    progress: Progress = lambda what, share: None,
) -> list[Attempt]:
    """Write the chosen attempts to one file, each as a recording of its own.

    Args:
        folder: of the study.
        open_view: draws the camera's pictures; none are made without it.
        oracle_path: gives the oracle's path from each start; without it none is shown.
        last_only: of the chosen attempts, write the one made last.

    Returns:
        the attempts written.

    Raises:
        RecordingUnavailable: there is nothing to write, or it cannot be written.
        StoreError: the store cannot be read.
    """
    with open_study(folder) as store:
        guard = ErasureGuard.of(store.path.parent)
        attempts = choose(store, participant=participant, rollout=rollout, attempt=attempt)
        attempts = attempts[-1:] if last_only else attempts
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            with guard.reading(), workspace(out) as room:
                files: list[Path] = []
                for number, chosen in enumerate(attempts):
                    progress("rebuilding recordings", number / len(attempts))
                    files.append(room / f"{number}.rrd")
                    data = store.attempt_data(chosen)
                    write_recording(data, files[-1], open_view=open_view, oracle_path=oracle_path)
                with guard.placing():
                    rename_durably(_join(files, room / "all.rrd"), out)
        except OSError as error:
            raise RecordingUnavailable(
                f"Cannot write {out}: {refusal(error, 'choose another file')}."
            ) from error
    progress("rebuilding recordings", 1.0)
    return attempts


def write_recording(
    data: AttemptData,
    out: Path,
    *,
    open_view: OpenView | None = None,
    oracle_path: OraclePath | None = None,
) -> None:
    """Write one attempt to a file, which is there whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    attempt, world, start = data.attempt, data.rollout.world, data.start
    stream = new_stream(data.rollout, attempt.participant, attempt.attempt)
    shown_as = layout.blueprint(world, start, pictures=open_view is not None)
    with whole_recording(stream, out, shown_as):
        stream.send_recording_name(layout.recording_name(*attempt.key))
        log_world(stream, world, start)
        log = DriveLog(stream, data.rollout.control_hz)
        log.steps(data.steps, data.times)
        log.events(data.events)
        log_end(stream, data, oracle_path and oracle_path(world, start))
        if open_view is not None and data.steps:
            with open_view(world) as view:
                shown = _shown_steps(data.steps, data.rollout.control_hz)
                log.pictures(shown, _jpegs(view, shown))


@contextmanager
def whole_recording(
    stream: rr.RecordingStream, out: Path, blueprint: rrb.Blueprint
) -> Generator[None]:
    """Write what the block logs to ``out``, whole; if the block raises, ``out`` is as it was.

    Raises:
        OSError: it cannot be written.
    """
    with whole_file(out) as part:
        try:
            memory = collect_stream(stream, blueprint)
            yield
            part.write_bytes(memory.drain_as_bytes())
        finally:
            stream.disconnect()


def _shown_steps(steps: Sequence[LabelledStep], control_hz: float) -> Sequence[LabelledStep]:
    """The steps that get a camera picture."""
    return steps[:: max(1, round(control_hz / PICTURES_HZ))]


def _jpegs(view: View, steps: Sequence[LabelledStep], car: CarConfig | None = None) -> list[bytes]:
    """The camera's view at each step, as JPEG files."""
    car = car or CarConfig()
    drawn: list[bytes] = []
    for step in steps:
        pose = Pose2D(step.x_m, step.y_m, step.heading_rad)
        file = BytesIO()
        frame = view.frame(pose, car.road_wheel_rad(step.executed_wheel))
        Image.fromarray(frame).save(file, "JPEG", quality=JPEG_QUALITY)
        drawn.append(file.getvalue())
    return drawn


def _join(files: Sequence[Path], out: Path) -> Path:
    """Merge recordings into ``out``; returns the file that holds them all.

    Raises:
        OSError: ``out`` cannot be written.
    """
    if len(files) == 1:
        return files[0]
    command = [str(rerun_executable()), "rrd", "merge", *map(str, files), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["it said nothing"]
        raise why_not_written(out, f"they cannot be joined: {said[-1].rstrip('.')}")
    check_written(out)  # also where Rerun ends well, for want of room
    return out
