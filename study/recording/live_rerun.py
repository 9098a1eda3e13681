"""Rerun while a drive goes on: a file at the end of each attempt, and the live viewer.

Rerun only shows the data: whatever goes wrong here becomes a warning, the drive and the database
go on, and ``steerlab replay`` makes the recording anew.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import rename_durably, workspace
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.world import Block, WorldSpec
from steerlab.study.store.records import (
    Attempt,
    AttemptData,
    AttemptStatus,
    Event,
    StoredRollout,
)
from steerlab.teleop.timing import StepTiming

if TYPE_CHECKING:  # slow to import: done in the writer thread
    import rerun as rr

    from steerlab.study.recording.drive_log import DriveLog
    from steerlab.study.recording.viewer import ViewerProcess

CLOSE_S = 5.0  # a viewer that takes longer to close a stream hangs
_NOT_WRITTEN, _LOST = "This drive's recording is not written", "The live viewer was lost"
_ROOM = "attempt"  # files are prepared under this name
_STEPS_BETWEEN_LOOKS = 20  # how often to look whether the viewer is still there

OpenViewer = Callable[[], "ViewerProcess"]


class LiveRerun:
    """Writes recordings and feeds the viewer, in the writer thread; its methods never raise.

    Args:
        folder: of the recordings.
        warn: called with a warning's text.
        open_viewer: starts the live viewer; None for none.
    """

    def __init__(
        self, folder: Path, warn: Callable[[str], None], open_viewer: OpenViewer | None = None
    ) -> None:
        self._folder = folder
        self._warn = warn
        self._warned: set[str] = set()
        self._viewer: ViewerProcess | None = None
        self._file: rr.RecordingStream | None = None
        self._memory: rr.MemoryRecording | None = None
        self._path = folder
        self._live: rr.RecordingStream | None = None
        self._logs: dict[str, DriveLog] = {}
        self._steps = 0
        with self._guarded("Recordings are not written"):
            folder.mkdir(exist_ok=True)
            with workspace(folder / _ROOM):  # removes what a killed program left, of any attempt
                _warm_up()
        if open_viewer is not None:
            with self._guarded("There is no live viewer"):
                self._viewer = open_viewer()

    def begin(self, rollout: StoredRollout, attempt: Attempt, start: Pose2D) -> None:
        """Begin to collect the attempt's recording, and show the attempt in the viewer."""
        self._steps = 0
        with self._guarded(_NOT_WRITTEN, "file"):
            from steerlab.study.recording.rebuild import (
                collect_stream,
                new_stream,
                recording_file,
            )

            self._path = self._folder / recording_file(*attempt.key)
            self._file = new_stream(rollout, attempt.participant, attempt.attempt)
            self._memory = collect_stream(self._file, _layout(rollout, start))
            self._logs["file"] = _log_beginning(self._file, rollout, attempt, start)
        if self._viewer_is_there() and self._viewer is not None:
            with self._guarded("The drive is not shown in the viewer", "live"):
                from steerlab.study.recording.rebuild import connect_stream, new_stream

                self._live = new_stream(rollout, attempt.participant, attempt.attempt)
                layout = _layout(rollout, start)
                connect_stream(self._live, self._viewer.url, layout)
                self._logs["live"] = _log_beginning(self._live, rollout, attempt, start)

    def step(self, step: LabelledStep, times: StepTiming | None) -> None:
        """Log a step."""
        self._steps += 1
        if self._live is not None and self._steps % _STEPS_BETWEEN_LOOKS == 0:
            self._viewer_is_there()
        self._log_to_each(lambda log: log.step(step, times))

    def event(self, event: Event) -> None:
        """Log an event."""
        self._log_to_each(lambda log: log.event(event))

    def end(self, read: Callable[[], AttemptData]) -> None:
        """Log what is known only now, and write the attempt's file."""
        self._viewer_is_there()
        if self._file is not None and self._memory is not None:
            with self._guarded(_NOT_WRITTEN, "file"):
                from steerlab.study.recording.scene import log_end

                log_end(self._file, read())
                with workspace(self._folder / _ROOM) as room:
                    part = room / self._path.name
                    part.write_bytes(self._memory.drain_as_bytes())
                    rename_durably(part, self._path)
                self._file.disconnect()
        if self._live is not None:
            with self._guarded(_LOST, "live"):
                from steerlab.study.recording.scene import log_end

                log_end(self._live, read())
                self._live.flush(timeout_sec=0.0)
        self._close_streams()

    def close(self) -> None:
        """Close streams and viewer; an attempt that has no end in the study gets no file."""
        self._close_streams()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _log_to_each(self, act: Callable[["DriveLog"], None]) -> None:
        for name, log in list(self._logs.items()):
            with self._guarded(_NOT_WRITTEN if name == "file" else _LOST, name):
                act(log)

    def _viewer_is_there(self) -> bool:
        if self._viewer is None:
            return False
        if self._viewer.alive:
            return True
        self._warn_once("The live viewer was closed; the drive goes on without it.")
        self._drop_viewer()
        return False

    def _close_streams(self) -> None:
        """Close both streams; a viewer that hangs would block the second for ever, so it is ended."""
        self._file = self._memory = None
        self._logs.pop("file", None)
        live, self._live = self._live, None
        self._logs.pop("live", None)
        if live is None:
            return
        closing = Thread(target=live.disconnect, name="rerun-viewer-close", daemon=True)
        closing.start()
        closing.join(CLOSE_S)
        if closing.is_alive():
            self._warn_once("The live viewer hung and was ended; the drives go on without it.")
            self._drop_viewer()
            closing.join()

    def _drop_viewer(self) -> None:
        self._logs.pop("live", None)
        if self._viewer is not None:
            self._viewer.close()  # before its stream is dropped, which waits for one that hangs
            self._viewer = None
        self._live = None

    @contextmanager
    def _guarded(self, what: str, log: str | None = None) -> Generator[None]:
        """Make any failure a warning, and no longer use the log that failed."""
        try:
            yield
        except BaseException as error:  # a panic in Rerun is no Exception; Ctrl-C is not seen here
            said = refusal(error) if isinstance(error, OSError) else str(error)
            reason = " ".join(said.split()) or type(error).__name__
            self._warn_once(
                f"{what}: {reason.rstrip('.')}. The data is safe in study.db; steerlab replay "
                f"shows it."
            )
            if log is not None:
                self._logs.pop(log, None)
                if log == "file":
                    self._file = None
                else:
                    self._live = None

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)


def _layout(rollout: StoredRollout, start: Pose2D) -> Any:
    from steerlab.study.recording.layout import blueprint

    return blueprint(rollout.world, start, pictures=False)


def _log_beginning(
    stream: "rr.RecordingStream", rollout: StoredRollout, attempt: Attempt, start: Pose2D
) -> "DriveLog":
    from steerlab.study.recording.drive_log import DriveLog
    from steerlab.study.recording.layout import recording_name
    from steerlab.study.recording.scene import log_world

    stream.send_recording_name(recording_name(*attempt.key))
    log_world(stream, rollout.world, start)
    return DriveLog(stream, rollout.control_hz)


def _warm_up() -> None:
    """Log all that a recording holds to a stream that is dropped: the first time takes up to 1 s."""
    from steerlab.study.recording.rebuild import new_stream
    from steerlab.study.recording.scene import log_end

    start = Pose2D(0.0, 0.0, 0.0)
    world = WorldSpec(
        name="warm-up", ball_xy_m=(20.0, 0.0), start=start, blocks=(Block(9.0, 9.0, 1.0, 1.0),)
    )
    rollout = StoredRollout(name="warm-up", world=world, control_hz=20.0, seed=None, steps=None)
    attempt = Attempt(
        participant="nobody",
        rollout="warm-up",
        attempt=0,
        status=AttemptStatus.RUNNING,
        order_index=0,
    )
    times = StepTiming(
        deadline_ns=0,
        actual_ns=1,
        sample_ns=2,
        event_age_ns=None,
        overrun=False,
        focus=True,
        device_ok=True,
    )
    event = Event(step=0, at_ns=0, what="warm-up")
    data = AttemptData(
        rollout=rollout,
        attempt=attempt,
        session=None,
        steps=[_made_up_step(0), _made_up_step(1)],
        times=[times, times],
        events=[event],
        flags=[],
    )
    stream = new_stream(rollout, attempt.participant, attempt.attempt)
    memory = stream.memory_recording()
    stream.send_blueprint(_layout(rollout, start))
    log = _log_beginning(stream, rollout, attempt, start)
    log.event(event)
    for step in data.steps:
        log.step(step, times)
    log_end(stream, data)
    memory.drain_as_bytes()  # else Rerun says in the terminal that it drops data
    stream.disconnect()


def _made_up_step(step: int) -> LabelledStep:
    return LabelledStep(
        participant="nobody",
        rollout="warm-up",
        attempt=0,
        step=step,
        t_s=step / 20.0,
        x_m=float(step),
        y_m=0.0,
        heading_rad=0.0,
        speed_mps=5.0,
        lateral_speed_mps=0.0,
        yaw_rate_radps=0.0,
        acceleration_x_mps2=0.0,
        acceleration_y_mps2=0.0,
        robot_wheel=0.0,
        teacher_label=0.0,
        oracle_label=0.0,
        executed_wheel=0.0,
        gate=Driver.ROBOT,
        label_valid=True,
    )
