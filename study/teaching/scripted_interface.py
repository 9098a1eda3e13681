"""A scripted participant teaches: the same loop and record, without a window or time."""

from dataclasses import replace
from math import nan

from steerlab.learning.agents.drive import HeldGate, RoundDrive
from steerlab.learning.agents.teaching_contract import AfterRest, FinishedDrive, Work
from steerlab.sim.live_teacher import LiveTeacher, Responding
from steerlab.sim.progress import Progress
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.unusual_teachers import UnusualTeacher
from steerlab.study.teaching.conditions import TeacherAction, TeachingMode
from steerlab.study.teaching.live_round import LiveRound, make_live_round
from steerlab.study.teaching.teaching_log import outcome_event
from steerlab.teleop.attempt import Recorder
from steerlab.teleop.devices.contract import (
    Button,
    Device,
    DeviceError,
    DeviceInfo,
    DeviceSample,
    InputKind,
)
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.loop import NullClock, run_drive


class ScriptedInterface:
    """Drives without waiting, never stops, and does all there is to do.

    Args:
        mode: how the condition is taught.
        rounds: after the first demonstration, for ``progress``.

    Raises:
        DeviceError: the device can only label what was recorded before.
    """

    def __init__(
        self,
        device: Device,
        recorder: Recorder,
        *,
        participant: str,
        mode: TeachingMode,
        rounds: int,
        progress: Progress,
    ) -> None:
        if device.info.kind is InputKind.TRACE:
            raise DeviceError(
                f"{device.info.name!r} is a trace: it answers drives that were recorded, and a "
                f"robot that learns drives anew each time. Give a device, or scripted:KIND:SEED."
            )
        self._device, self._recorder = device, recorder
        self._participant, self._mode = participant, mode
        self._rounds, self._progress = rounds, progress

    def drive(self, drive: RoundDrive) -> FinishedDrive:
        """One finished attempt."""
        live, device = make_live_round(drive, self._mode), self._device
        if isinstance(device, ScriptedDevice):
            teacher = device.teacher
            if not isinstance(teacher, ScriptedTeacher | UnusualTeacher):
                raise DeviceError(
                    f"{teacher.name!r} labels recorded rollouts only; it cannot teach."
                )
            device = LiveScriptedDevice(teacher, live)
        record = self._recorder.begin(live.drive)
        run_drive(
            live.drive,
            device,
            participant=self._participant,
            order=record.order,
            attempt=record.attempt,
            clock=NullClock(),
            sink=record,
        )
        record.event(0, outcome_event(live.drive.outcome))
        record.finish(())
        return live.finished(record.attempt)

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> AfterRest:
        """Do both."""
        learn(lambda share: self._progress("teaching", (number + share) / (self._rounds + 1)))
        meanwhile(lambda share: None)
        return AfterRest.GO_ON

    def wait(self, what: str, work: Work) -> bool:
        """Do it."""
        work(lambda share: self._progress("teaching", share))
        return True


class LiveScriptedDevice:
    """A ``Device`` for one round: a scripted teacher who knows only what has been.

    Offline, as in calibration, scripted teachers see a rollout's future; here nobody does, so one
    who anticipates (a negative delay) labels as if without delay (``sim.live_teacher``). Who labels
    does so in the style they correct with, who drives in their softened one. Who may take over does
    when the learner's own gate for scripted people finds it dangerous.
    """

    def __init__(self, teacher: Responding, live: LiveRound) -> None:
        self._name, self._round = teacher.name, live
        self._env = live.round_drive.env
        self._labels = live.hands is TeacherAction.LABEL
        self._live = LiveTeacher(teacher, "raw" if self._labels else "softened")
        takes_over = live.hands is TeacherAction.TAKE_OVER
        self._gate = HeldGate(live.round_drive.gate) if takes_over else None
        self._last = DeviceSample(wheel=None, ok=False)

    @property
    def info(self) -> DeviceInfo:
        """The teacher's name."""
        return DeviceInfo(kind=InputKind.SCRIPTED, name=self._name)

    def connect(self) -> None:
        """Nothing to open."""

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """A new drive."""
        drive = self._round.round_drive
        self._live.begin(replace(drive.context, order=order, attempt=attempt))
        self._last = DeviceSample(wheel=None, ok=False)
        if self._gate is not None:
            self._gate.begin(drive.number, drive.gate_rng())

    def read(self, step: int | None = None) -> DeviceSample:
        """The wheel for ``step``; without one, what was said last."""
        if step is not None:
            state = self._env.driving.state
            truth = self._env.oracle(state)
            robot = self._round.robot(state) if self._labels else nan
            wheel = self._live.react(truth, robot)
            self._last = DeviceSample(wheel=wheel, buttons=self._pressed(step, wheel, truth))
        return self._last

    def disconnect(self) -> None:
        """Nothing to close."""

    def _pressed(self, step: int, wheel: float, truth: float) -> frozenset[Button]:
        if self._gate is None:
            return frozenset()
        robot = self._round.robot(self._env.driving.state)
        held = self._gate.who_drives(step, robot, wheel, truth, nan)
        return frozenset({Button.TAKE_OVER} if held is Driver.TEACHER else ())
