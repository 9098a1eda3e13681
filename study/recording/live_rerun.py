"""Rerun while a drive goes on: a file for each attempt, and the live viewer.

Rerun is a view of the data, never the data: whatever goes wrong here becomes a warning, the drive
and the database go on, and ``steerlab replay`` makes the recording anew.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import LabelledStep
from steerlab.study.store.records import Attempt, Event, StoredRollout
from steerlab.teleop.timing import StepTiming

if TYPE_CHECKING:  # slow to import: done in the writer thread
    import rerun as rr

    from steerlab.study.recording.attempt_data import AttemptData
    from steerlab.study.recording.drive_log import DriveLog
    from steerlab.study.recording.viewer import ViewerProcess

CLOSE_S = 5.0  # a viewer that takes longer to let go of a stream hangs
_FLUSH_S = 10.0
_STEPS_BETWEEN_LOOKS = 20  # at whether the viewer is still there

OpenViewer = Callable[[], "ViewerProcess"]


class LiveRerun:
    """Belongs to the writer thread; nothing it does raises.

    Args:
        folder: of the recordings.
        warn: takes a warning's text.
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
        self._live: rr.RecordingStream | None = None
        self._logs: dict[str, DriveLog] = {}
        self._steps = 0
        with self._guarded("Recordings are not written"):
            folder.mkdir(exist_ok=True)
            from steerlab.study.recording.warm_up import warm_up

            warm_up()
        if open_viewer is not None:
            with self._guarded("There is no live viewer"):
                self._viewer = open_viewer()

    def begin(self, rollout: StoredRollout, attempt: Attempt, start: Pose2D) -> None:
        """Open the attempt's file, and show the attempt in the viewer."""
        self._steps = 0
        with self._guarded("This drive's recording is not written", "file"):
            from steerlab.study.recording.rebuild import new_stream, recording_file

            path = self._folder / recording_file(*attempt.key)
            self._file = new_stream(rollout, attempt.participant, attempt.attempt)
            self._file.save(path, default_blueprint=_layout(rollout, start))
            self._logs["file"] = _log_beginning(self._file, rollout, attempt, start)
        if self._viewer_is_there() and self._viewer is not None:
            with self._guarded("The drive is not shown in the viewer", "live"):
                from steerlab.study.recording.rebuild import new_stream

                self._live = new_stream(rollout, attempt.participant, attempt.attempt)
                layout = _layout(rollout, start)
                self._live.connect_grpc(self._viewer.url, default_blueprint=layout)
                self._logs["live"] = _log_beginning(self._live, rollout, attempt, start)

    def step(self, step: LabelledStep, times: StepTiming | None) -> None:
        """Log a step."""
        self._steps += 1
        if self._live is not None and self._steps % _STEPS_BETWEEN_LOOKS == 0:
            self._viewer_is_there()
        self._each(lambda log: log.step(step, times))

    def event(self, event: Event) -> None:
        """Log an event."""
        self._each(lambda log: log.event(event))

    def end(self, read: Callable[[], "AttemptData"]) -> None:
        """Log what is known only now, and close the attempt's file."""
        self._viewer_is_there()
        if self._file is not None:
            with self._guarded("This drive's recording is incomplete", "file"):
                from steerlab.study.recording.scene import log_end

                log_end(self._file, read())
                self._file.flush(timeout_sec=_FLUSH_S)
                self._file.disconnect()
        if self._live is not None:
            with self._guarded("The live viewer was lost", "live"):
                from steerlab.study.recording.scene import log_end

                log_end(self._live, read())
                self._live.flush(timeout_sec=0.0)
        self._let_go()

    def close(self) -> None:
        """Close file and viewer, in the middle of an attempt too."""
        if self._file is not None:
            with self._guarded("This drive's recording is incomplete"):
                self._file.disconnect()
        self._let_go()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _each(self, act: Callable[["DriveLog"], None]) -> None:
        for name, log in list(self._logs.items()):
            what = {
                "file": "This drive's recording is incomplete",
                "live": "The live viewer was lost",
            }[name]
            with self._guarded(what, name):
                act(log)

    def _viewer_is_there(self) -> bool:
        if self._viewer is None:
            return False
        if self._viewer.alive:
            return True
        self._say("The live viewer was closed; the drive goes on without it.")
        self._let_go_of_viewer()
        return False

    def _let_go(self) -> None:
        """Drop both streams; a viewer that hangs would hold the second for ever, so it is ended."""
        self._file = None
        self._logs.pop("file", None)
        live, self._live = self._live, None
        self._logs.pop("live", None)
        if live is None:
            return
        closing = Thread(target=live.disconnect, name="rerun-viewer-close", daemon=True)
        closing.start()
        closing.join(CLOSE_S)
        if closing.is_alive():
            self._say("The live viewer hung and was ended; the drives go on without it.")
            self._let_go_of_viewer()
            closing.join()

    def _let_go_of_viewer(self) -> None:
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
        except BaseException as error:  # a panic in Rerun is no Exception; Ctrl-C never gets here
            reason = " ".join(str(error).split()) or type(error).__name__
            self._say(
                f"{what}: {reason.rstrip('.')}. The data is safe in study.db; steerlab replay "
                f"shows it."
            )
            if log is not None:
                self._logs.pop(log, None)
                if log == "file":
                    self._file = None
                else:
                    self._live = None

    def _say(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)


def _layout(rollout: StoredRollout, start: Pose2D) -> Any:
    from steerlab.study.recording.blueprint import blueprint

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
