"""Who drives in each step: the robot, the person, or the robot until the person takes over."""

from dataclasses import dataclass
from typing import Protocol

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import Driver
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceError, DeviceSample


@dataclass(frozen=True, slots=True)
class Command:
    """What the car gets for one step; without a throttle it cruises."""

    gate: Driver
    wheel: float
    throttle: float | None = None
    brake: float = 0.0


class WhoDrives(Protocol):
    """Decides whose wheel the car gets."""

    def begin(self) -> None:
        """An attempt starts."""
        ...

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The command for this step.

        Raises:
            DeviceError: the person drives and the device says nothing.
        """
        ...


class RobotDrives:
    """The person's wheel is a label and nothing else, as in DAgger."""

    def begin(self) -> None:
        """Nothing to forget."""

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The robot's wheel at cruise speed."""
        return Command(Driver.ROBOT, robot_wheel)


class PersonDrives:
    """The person drives, with pedals if the device has any; else at cruise speed."""

    def __init__(self, *, pedals: bool) -> None:
        self._pedals = pedals

    def begin(self) -> None:
        """Nothing to forget."""

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The person's wheel and pedals."""
        wheel = _wheel(sample)
        if not self._pedals:
            return Command(Driver.TEACHER, wheel)
        if sample.throttle is None or sample.brake is None:
            raise DeviceError(
                "The person drives with pedals, and the device has none or they are unknown; "
                "press each once, or drive at cruise speed."
            )
        return Command(Driver.TEACHER, wheel, sample.throttle, sample.brake)


@dataclass(frozen=True, kw_only=True)
class TakeoverConfig:
    """How control changes hands.

    Attributes:
        blend_steps: control steps over which the jump between the two wheels is let out.
    """

    blend_steps: int = 10  # 0.5 s at 20 Hz

    def __post_init__(self) -> None:
        if self.blend_steps < 1:
            raise InvalidConfig(f"blend_steps is {self.blend_steps}; it must be at least 1.")


class Takeover:
    """The robot drives; the person does while holding the take-over button, as in HG-DAgger.

    Bumpless: when control changes hands, the car's wheel goes on from where it was, and the
    difference to the new driver's wheel fades linearly.
    """

    def __init__(self, config: TakeoverConfig | None = None) -> None:
        self._fade = 1.0 / (config or TakeoverConfig()).blend_steps
        self.begin()

    def begin(self) -> None:
        """The robot drives first."""
        self._gate = Driver.ROBOT
        self._last: float | None = None
        self._offset, self._left = 0.0, 0.0

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The wheel of whoever drives, plus what is left of the jump."""
        held = sample.ok and Button.TAKE_OVER in sample.buttons
        gate = Driver.TEACHER if held else Driver.ROBOT
        target = _wheel(sample) if held else robot_wheel
        if gate is not self._gate and self._last is not None:
            self._offset, self._left = self._last - target, 1.0
        self._gate = gate
        wheel = target + self._offset * self._left
        self._left = max(0.0, self._left - self._fade)
        self._last = min(WHEEL_LIMIT, max(-WHEEL_LIMIT, wheel))
        return Command(gate, self._last)


def _wheel(sample: DeviceSample) -> float:
    if not sample.ok or sample.wheel is None:
        raise DeviceError(
            "The person drives and the device says nothing; plug it in, move it once, and redo "
            "the drive."
        )
    return sample.wheel
