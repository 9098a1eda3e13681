"""A scripted teacher as a device: its label is the wheel's position."""

from steerlab.sim.rollout import Rollout
from steerlab.sim.teachers import Teacher
from steerlab.teleop.devices.contract import DeviceError, DeviceInfo, DeviceSample, InputKind


class ScriptedDevice:
    """Steers as ``teacher`` labels, one label a control step."""

    def __init__(self, teacher: Teacher) -> None:
        self.teacher = teacher
        self._last = DeviceSample(wheel=None, ok=False)

    @property
    def info(self) -> DeviceInfo:
        """The teacher's name."""
        return DeviceInfo(kind=InputKind.SCRIPTED, name=self.teacher.name)

    def connect(self) -> None:
        """Nothing to open."""

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Prepare the teacher for a rollout.

        Raises:
            DeviceError: there is no rollout; this teacher labels recorded ones only.
        """
        if rollout is None:
            raise DeviceError(f"{self.teacher.name!r} labels recorded rollouts only.")
        self._last = DeviceSample(wheel=None, ok=False)
        self.teacher.begin(rollout, order=order, attempt=attempt)

    def read(self, step: int | None = None) -> DeviceSample:
        """The label for ``step``; without a step, the last sample."""
        if step is not None:
            label = self.teacher.label(step)
            self._last = DeviceSample(wheel=label, ok=label is not None)
        return self._last

    def disconnect(self) -> None:
        """Nothing to close; the last label no longer counts."""
        self._last = DeviceSample(wheel=None, ok=False)
