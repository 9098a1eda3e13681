"""Recording a participant's session: into the study's database, and a Rerun file an attempt."""

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Self

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.folder_lock import RUN_LOCK, FolderLock, LockedOut, locked
from steerlab.sim.files.provenance import versions
from steerlab.sim.files.refusal import refusal
from steerlab.sim.progress import Progress
from steerlab.study.recording.live_rerun import LiveRerun, OpenViewer
from steerlab.study.recording.writer import AttemptWriter, RecordingError, WriterThread
from steerlab.study.store.errors import StoreError
from steerlab.study.store.records import Attempt, SessionRecord, StoredRollout
from steerlab.study.store.store import STUDY_FILE, StudyStore
from steerlab.teleop.devices.contract import DeviceInfo
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.latency import input_latency_ms
from steerlab.teleop.pacing import PacingConfig

if TYPE_CHECKING:
    from steerlab.study.recording.rebuild import OpenView, OraclePath
    from steerlab.teleop.screen.drive_screen import DriveScreen

RECORDINGS = "recordings"
"""The subfolder of the Rerun recordings."""
AFTER_A_CRASH = "found running after a crash"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """Participant, device and display of a session; see ``SessionRecord`` in the store.

    Attributes:
        role: of the participant in the study, such as ``seen``.
    """

    participant: str
    role: str
    device: DeviceInfo
    control_hz: float
    display_hz: float | None = None
    screen_px: tuple[int, int] | None = None
    input_latency_ms: float | None = None
    settings: Mapping[str, str] = field(default_factory=dict)

    def before(self, screen: "DriveScreen | None", pacing: PacingConfig) -> "SessionInfo":
        """With what is known of the window; the same where nobody looks, or nothing is left."""
        if screen is None or screen.resolution is None:
            return self
        return replace(
            self,
            display_hz=pacing.display_hz,
            screen_px=screen.resolution.window_px,
            input_latency_ms=input_latency_ms(screen.resolution.frame_ms, pacing),
            settings={**self.settings, **screen.settings},
        )


class SessionRecorder:
    """Records a session into a study folder, which is made if there is none.

    Attempts that a crash left running are abandoned first. Use it with ``with``: leaving the block
    ends an attempt that is still open, and waits until everything is on the disk.

    Args:
        folder: of the study; ``study.db`` and ``recordings/`` lie there.
        rerun: write a Rerun recording of each attempt.
        open_viewer: starts a live viewer, such as ``ViewerProcess``; it ends with the session.
        lock: the folder's ``RUN_LOCK``, if the caller holds it; None takes it.

    Attributes:
        session: the id under which it is kept.
        resumed: attempts that a crash had left running.
        warnings: what went wrong without harm to the data, such as a viewer that was closed.

    Raises:
        RecordingError: another program records into this folder.
        StoreError: the database cannot be opened or written.
    """

    def __init__(
        self,
        folder: Path,
        info: SessionInfo,
        *,
        rerun: bool = True,
        open_viewer: OpenViewer | None = None,
        lock: FolderLock | None = None,
    ) -> None:
        self.folder = folder
        self.warnings: list[str] = []
        self._info = info
        self._open: AttemptWriter | None = None
        self._ended: list[Attempt] = []
        self._live: LiveRerun | None = None
        with ExitStack() as undo:
            if lock is None:
                _lock(folder, undo)
            self._thread = WriterThread()
            undo.callback(self._thread.stop)
            self._store = self._thread.ask(self._open_store)
            undo.callback(lambda: self._thread.ask(self._store.close))
            self.resumed = self._thread.ask(lambda: self._store.abandon_running(AFTER_A_CRASH))
            self.session = self._thread.ask(self._begin_session)
            if rerun:
                self._live = self._thread.ask(
                    lambda: LiveRerun(folder / RECORDINGS, self._warn, open_viewer)
                )
            self._undo = undo.pop_all()

    def begin(self, drive: Drive) -> AttemptWriter:
        """Open the participant's next attempt at a drive; takes some milliseconds.

        Raises:
            RecordingError: it cannot be kept.
        """
        if self._open is not None and self._open.open:
            self._open.abandon("another attempt was begun")
        replayed = drive.rollout
        rollout = (
            StoredRollout.of(replayed)
            if replayed is not None
            else StoredRollout(
                name=drive.name,
                world=drive.world,
                control_hz=float(drive.control_hz),
                seed=None,
                steps=None,
            )
        )
        start = drive.world.start if replayed is None else replayed.pose_at(0)

        def begin() -> Attempt:
            self._store.add_rollout(rollout)
            begun = self._store.begin_attempt(
                self._info.participant, rollout.name, session=self.session
            )
            if self._live is not None:
                self._live.begin(rollout, begun, start)
            return begun

        try:
            begun = self._thread.ask(begin)
        except StoreError as error:
            raise RecordingError(f"The drive cannot be recorded. {error}") from error
        self._open = AttemptWriter(self._thread, self._store, self._live, begun)
        self._ended.append(begun)
        return self._open

    def add_pictures(
        self,
        open_view: "OpenView",
        *,
        oracle_path: "OraclePath | None" = None,
        progress: "Progress" = lambda what, share: None,
    ) -> None:
        """Write this session's recordings anew with the camera's pictures; takes seconds each.

        Call it between drives or after the last, in the thread that may draw.
        """
        from steerlab.study.recording.rebuild import recording_file, write_recording

        self._thread.ask(lambda: None)  # until the last recording is closed
        ended, self._ended = self._ended, []
        with StudyStore.open(self.folder / STUDY_FILE, read_only=True) as store:
            now = {attempt.key: attempt for attempt in store.attempts()}
            for number, attempt in enumerate(ended):
                progress("drawing pictures", number / len(ended))
                out = self.folder / RECORDINGS / recording_file(*attempt.key)
                try:
                    data = store.attempt_data(now[attempt.key])
                    write_recording(data, out, open_view=open_view, oracle_path=oracle_path)
                except (OSError, SteerlabError) as error:
                    self._thread.ask(
                        lambda error=error, out=out: self._warn(
                            f"{out.name} has no pictures: {error}"
                        )
                    )
        progress("drawing pictures", 1.0)

    def close(self) -> None:
        """End what is open and wait until all is on the disk; calling it again does nothing."""
        self._close(told=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._close(told=isinstance(error, RecordingError))

    def _close(self, *, told: bool) -> None:
        """Close; ``told`` if the caller knows already that no more can be kept."""
        if self._open is not None and self._open.open:
            try:
                self._open.abandon("the session ended during it")
            except RecordingError as error:  # it stays marked as running, for the next start
                if not told:
                    _log.warning("%s", error)
        self._open = None
        if self._live is not None:
            self._thread.ask(self._live.close)
            self._live = None
        self._undo.close()

    # In the writer thread, which owns the store.

    def _open_store(self) -> StudyStore:
        file = self.folder / STUDY_FILE
        return StudyStore.open(file) if file.exists() else StudyStore.create(file)

    def _begin_session(self) -> str:
        info, device = self._info, self._info.device
        store = self._store
        store.add_participant(info.participant, info.role)
        sessions = store.sessions().values()
        number = 1 + sum(session.participant == info.participant for session in sessions)
        environment = versions()
        session = SessionRecord(
            id=f"{info.participant}-{number}",
            participant=info.participant,
            started_utc=datetime.now(UTC).isoformat(timespec="seconds"),
            input_kind=device.kind.value,
            device_name=device.name,
            device_guid=device.guid,
            profile_sha256=device.profile_sha256,
            force_feedback=device.force_feedback,
            device_details=device.details,
            screen_px=info.screen_px,
            display_hz=info.display_hz,
            control_hz=info.control_hz,
            input_latency_ms=info.input_latency_ms,
            settings=info.settings,
            steerlab_version=environment.pop("steerlab"),
            environment=environment,
        )
        store.add_session(session)
        return session.id

    def _warn(self, text: str) -> None:
        self.warnings.append(text)
        try:
            self._store.record("warning", " ".join(text.split()))
        except StoreError as error:  # the next step or the end of the attempt fails of the same
            text = f"{text} The warning is not kept: {error}"
        _log.warning("%s", text)


def _lock(folder: Path, undo: ExitStack) -> None:
    """Keep other recorders out of a study folder, which is made if there is none.

    Raises:
        RecordingError: another one is in it, or it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        undo.enter_context(locked(folder, RUN_LOCK, "records into"))
    except LockedOut as error:
        raise RecordingError(str(error)) from error
    except OSError as error:
        raise RecordingError(
            f"Cannot record into {folder}: {refusal(error, 'choose a folder that can be written')}."
        ) from error
