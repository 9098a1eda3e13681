"""A participant sits down: device, window, recorder and rollouts, for ``correct`` and for studies.

A person sits before a window; a script or a trace needs neither window nor time, and goes through
the same loop into the same record.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from steerlab.sim.files.folder_lock import FolderLock
from steerlab.sim.progress import Progress
from steerlab.sim.rollout import Rollout
from steerlab.study.recording.replay import oracle_path, view_of
from steerlab.study.recording.session_recorder import SessionInfo, SessionRecorder
from steerlab.teleop.attempt import Recorder, SessionConfig
from steerlab.teleop.devices.contract import Device, DeviceInfo, InputKind
from steerlab.teleop.devices.force_feedback import DEFAULT_AUTOCENTRE
from steerlab.teleop.devices.open import open_device
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.loop import NullClock, run_drive
from steerlab.teleop.markers import Markers, marked
from steerlab.teleop.pages import keeping_page
from steerlab.teleop.practice import Practice, PracticeConfig, PracticeResult
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.seat import seated
from steerlab.teleop.session import DriveSession, SessionEnd
from steerlab.teleop.timing_limits import LoopHealth


@dataclass(frozen=True, kw_only=True)
class CalibrationSessionConfig:
    """How a session goes.

    Attributes:
        viewer: also show the drives live in Rerun.
        recordings: write a Rerun recording of each attempt.
        pictures: draw the camera into the recordings when the session is over.
        autocentre: a wheel's centring force, 0 to 1; None leaves it alone.
        settings: kept with the session besides those of the display.
        markers: told of each attempt and step; None for nobody.
    """

    viewer: bool = False
    recordings: bool = True
    pictures: bool = True
    autocentre: float | None = DEFAULT_AUTOCENTRE
    screen: ScreenConfig = field(default_factory=ScreenConfig)
    session: SessionConfig = field(default_factory=SessionConfig)
    settings: Mapping[str, str] = field(default_factory=dict)
    markers: Markers | None = None


@dataclass(frozen=True, kw_only=True)
class Corrected:
    """How it ended.

    Attributes:
        done: rollouts with a finished attempt, of ``total``.
        health: the loop's, one of each attempt finished now.
        resumed: attempts a crash had left running, now abandoned.
        warnings: what went wrong without harm to the data.
    """

    end: SessionEnd
    done: int
    total: int
    health: tuple[LoopHealth, ...]
    resumed: int
    warnings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class CalibrationSession:
    """Who corrects which rollouts, and into which study.

    Attributes:
        left: what is to be corrected now, of ``total`` rollouts.
        lock: the folder's ``RUN_LOCK``, if the caller holds it.
    """

    folder: Path
    participant: str
    role: str
    left: Sequence[Rollout]
    total: int
    config: CalibrationSessionConfig
    lock: FolderLock | None = None

    def correct(self, device: str | Device, progress: Progress) -> Corrected:
        """Let the participant correct what is left, and keep it.

        Args:
            device: a specification, or a script's device itself.

        Raises:
            SteerlabError: device, display or study cannot be used; what is finished stays.
        """
        if not isinstance(device, str):
            return self._unattended(device, progress)
        if device.partition(":")[0] in (InputKind.SCRIPTED, InputKind.TRACE):
            return self._unattended(open_device(device), progress)
        return self._attended(device, progress)

    def _attended(self, spec: str, progress: Progress) -> Corrected:
        config = self.config
        with seated(spec, config.screen, autocentre=config.autocentre) as seat:
            screen, device = seat.screen, seat.device
            if self.left:
                screen.enter(self.left[0].world)  # measures how fast it can draw
            with self._recorder(device.info, screen) as recorder:
                session = DriveSession(
                    screen=screen,
                    device=device,
                    poll=seat.events.poll,
                    recorder=self._marked(recorder, device.info),
                    participant=self.participant,
                    total=self.total,
                    done=self.total - len(self.left),
                    config=config.session,
                )
                end = session.run(map(Replay, self.left))
                screen.show_page(keeping_page())
                self._draw(recorder, progress)
        return self._result(end, session.done, session.health, recorder)

    def _unattended(self, device: Device, progress: Progress) -> Corrected:
        device.connect()
        try:
            with self._recorder(device.info, None) as recorder:
                marked_recorder = self._marked(recorder, device.info)
                for number, rollout in enumerate(self.left):
                    progress("correcting", number / len(self.left))
                    drive = Replay(rollout)
                    record = marked_recorder.begin(drive)
                    run_drive(
                        drive,
                        device,
                        participant=self.participant,
                        order=record.order,
                        attempt=record.attempt,
                        clock=NullClock(),
                        sink=record,
                    )
                    record.finish(())
                progress("correcting", 1.0)
                self._draw(recorder, progress)
        finally:
            device.disconnect()
        return self._result(SessionEnd.DONE, self.total, [], recorder)

    def _marked(self, recorder: SessionRecorder, device: DeviceInfo) -> Recorder:
        who = self.participant
        return marked(recorder, self.config.markers, participant=who, device=device.name)

    def _recorder(self, device: DeviceInfo, screen: DriveScreen | None) -> SessionRecorder:
        from steerlab.study.recording.viewer import ViewerProcess

        config = self.config
        pacing = config.session.pacing
        settings = {
            **config.settings,
            "show_agent_wheel": str(config.session.show_agent_wheel).lower(),
        }
        info = SessionInfo(
            participant=self.participant,
            role=self.role,
            device=device,
            control_hz=pacing.control_hz,
            settings=settings,
        )
        viewer = ViewerProcess if config.viewer else None
        return SessionRecorder(
            self.folder,
            info.before(screen, pacing),
            rerun=config.recordings,
            open_viewer=viewer,
            lock=self.lock,
        )

    def _draw(self, recorder: SessionRecorder, progress: Progress) -> None:
        if self.config.recordings and self.config.pictures:
            recorder.add_pictures(view_of, oracle_path=oracle_path, progress=progress)

    def _result(
        self, end: SessionEnd, done: int, health: list[LoopHealth], recorder: SessionRecorder
    ) -> Corrected:
        return Corrected(
            end=end,
            done=done,
            total=self.total,
            health=tuple(health),
            resumed=len(recorder.resumed),
            warnings=tuple(recorder.warnings),
        )


def practise(
    spec: str,
    config: PracticeConfig,
    screen_config: ScreenConfig,
    *,
    autocentre: float | None = DEFAULT_AUTOCENTRE,
    markers: Markers | None = None,
) -> PracticeResult:
    """The practice drive, before a window of its own.

    Raises:
        SteerlabError: device or display cannot be used.
    """
    with seated(spec, screen_config, autocentre=autocentre) as seat:
        return Practice(
            screen=seat.screen,
            device=seat.device,
            poll=seat.events.poll,
            config=config,
            markers=markers,
        ).run()
