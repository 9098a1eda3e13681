"""A scripted participant teaches: the same course, loop and record, without a window or time."""

from collections.abc import Callable

from steerlab.sim.rollout import Outcome
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.unusual_teachers import UnusualTeacher
from steerlab.study.recording.session_recorder import SessionRecorder
from steerlab.study.teaching.live_scripted_device import LiveScriptedDevice
from steerlab.study.teaching.round_drive import RoundDrive
from steerlab.study.teaching.teacher_interface import Drove, Work
from steerlab.study.teaching.teaching_log import outcome_event
from steerlab.teleop.devices.contract import Device, DeviceError, InputKind
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.loop import NullClock, run_drive
from steerlab.teleop.screen.contract import Act


class ScriptedInterface:
    """Drives without waiting, never stops, and does all there is to do.

    Args:
        rounds: of the course, for ``progress``.

    Raises:
        DeviceError: the device can only label what was recorded before.
    """

    def __init__(
        self,
        device: Device,
        recorder: SessionRecorder,
        participant: str,
        rounds: int,
        progress: Callable[[str, float], None],
    ) -> None:
        if device.info.kind is InputKind.TRACE:
            raise DeviceError(
                f"{device.info.name!r} is a trace: it answers drives that were recorded, and a "
                f"robot that learns drives anew each time. Give a device, or scripted:KIND:SEED."
            )
        self._device, self._recorder = device, recorder
        self._participant, self._rounds, self._progress = participant, rounds, progress

    def drive(self, lesson: RoundDrive) -> Drove:
        """One finished attempt."""
        device = self._device
        if isinstance(device, ScriptedDevice):
            teacher = device.teacher
            if not isinstance(teacher, ScriptedTeacher | UnusualTeacher):
                raise DeviceError(
                    f"{teacher.name!r} labels recorded rollouts only; it cannot teach."
                )
            device = LiveScriptedDevice(teacher, lesson)
        record = self._recorder.begin(lesson.drive)
        run_drive(
            lesson.drive,
            device,
            participant=self._participant,
            order=record.order,
            attempt=record.attempt,
            clock=NullClock(),
            sink=record,
        )
        outcome = lesson.drive.outcome
        record.event(0, outcome_event(outcome))
        record.finish()
        return Drove(
            rollout=lesson.drive.name,
            attempt=record.attempt,
            outcome=outcome,
            seen=lesson.robot.seen,
        )

    def try_again(self, outcome: Outcome, left: int) -> bool:
        """It does."""
        return True

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> Act:
        """Do both."""
        learn(lambda share: self._progress("teaching", (number + share) / (self._rounds + 1)))
        meanwhile(lambda share: None)
        return Act.CONFIRM

    def wait(self, what: str, work: Work) -> bool:
        """Do it."""
        work(lambda share: self._progress("teaching", share))
        return True
