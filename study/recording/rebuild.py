"""Recordings made from the study store alone."""

import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import quote

import rerun as rr

from steerlab.sim.arrays import FloatArray
from steerlab.sim.geometry import Pose2D
from steerlab.sim.world import WorldSpec
from steerlab.study.recording import layout
from steerlab.study.recording.attempt_data import AttemptData, read_attempt
from steerlab.study.recording.blueprint import blueprint
from steerlab.study.recording.drive_log import DriveLog
from steerlab.study.recording.errors import RecordingUnavailable
from steerlab.study.recording.executable import rerun_executable
from steerlab.study.recording.pictures import OpenView, jpegs, shown_steps
from steerlab.study.recording.scene import log_end, log_world
from steerlab.study.recording.whole_recording import whole_recording
from steerlab.study.store.records import Attempt, StoredRollout
from steerlab.study.store.store import StudyStore

STUDY_FILE = "study.db"
OraclePath = Callable[[WorldSpec, Pose2D], FloatArray | None]
"""(points, 2) the way that the oracle would go from a pose; None where there is none."""
Progress = Callable[[str, float], None]


def recording_file(participant: str, rollout: str, attempt: int) -> str:
    """Name of an attempt's file; any pseudonym becomes a file name, and no two the same."""
    person = quote(participant, safe=" ").replace("-", "%2D")
    return f"{person}-{quote(rollout, safe=' ')}-{attempt}.rrd"


def new_stream(rollout: StoredRollout, participant: str, attempt: int) -> rr.RecordingStream:
    """A stream for one attempt, connected to nothing yet.

    All attempts at a rollout belong to one application, which is what Rerun keeps a layout for.
    """
    stream = rr.RecordingStream(
        f"steerlab {rollout.name}",
        recording_id=f"{participant}/{rollout.name}/{attempt}",
        send_properties=False,  # they hold the time at which this runs
    )
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


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
    progress: Progress = lambda what, share: None,
) -> list[Attempt]:
    """Write the chosen attempts to one file, each as a recording of its own.

    Args:
        folder: of the study.
        open_view: draws the camera's pictures; none are made without it.
        oracle_path: gives the oracle's way from each start; it is left out without it.

    Returns:
        the attempts written.

    Raises:
        RecordingUnavailable: there is nothing to write, or it cannot be written.
        StoreError: the store cannot be read.
    """
    with open_study(folder) as store:
        attempts = choose(store, participant=participant, rollout=rollout, attempt=attempt)
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as place:
                files: list[Path] = []
                for number, one in enumerate(attempts):
                    progress("rebuilding recordings", number / len(attempts))
                    files.append(Path(place) / f"{number}.rrd")
                    data = read_attempt(store, one)
                    write_recording(data, files[-1], open_view=open_view, oracle_path=oracle_path)
                _join(files, Path(place) / "all.rrd").replace(out)
        except OSError as error:
            raise RecordingUnavailable(
                f"Cannot write {out}: {error.strerror or error}. Choose another file or make room."
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
    shown_as = blueprint(world, start, pictures=open_view is not None)
    try:
        with whole_recording(stream, out, shown_as):
            stream.send_recording_name(layout.recording_name(*attempt.key))
            log_world(stream, world, start)
            log = DriveLog(stream, data.rollout.control_hz)
            log.steps(data.steps, data.times)
            log.events(data.events)
            log_end(stream, data, oracle_path and oracle_path(world, start))
            if open_view is not None and data.steps:
                with open_view(world) as view:
                    shown = shown_steps(data.steps, data.rollout.control_hz)
                    log.pictures(shown, jpegs(view, shown))
    except RuntimeError as error:  # what Rerun raises when a write fails
        raise OSError(f"{error}") from error


def _join(files: Sequence[Path], out: Path) -> Path:
    if len(files) == 1:
        return files[0]
    command = [str(rerun_executable()), "rrd", "merge", *map(str, files), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    if done.returncode != 0 or not out.is_file():
        raise RecordingUnavailable(f"Cannot join {len(files)} recordings: {done.stderr.strip()}.")
    return out
