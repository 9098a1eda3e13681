"""A gamepad's stick as a wheel: a thumb jumps, so the wheel follows it at a limited rate."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter_ns

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import (
    Button,
    DeviceError,
    DeviceInfo,
    DeviceSample,
    InputKind,
)
from steerlab.teleop.devices.joystick import (
    JoystickInfo,
    RawJoystick,
    RawSample,
    choose_joystick,
    list_joysticks,
)
from steerlab.teleop.devices.profile import this_system
from steerlab.teleop.devices.profile_folder import find_profile, shipped_profiles, user_profiles
from steerlab.teleop.sdl import SdlEvents


@dataclass(frozen=True, kw_only=True)
class GamepadConfig:
    """Where things are on a pad; the numbers are those of Linux' Xbox and PlayStation drivers.

    Attributes:
        stick_axis: the left stick's x axis, -1 at the left.
        throttle_axis, brake_axis: triggers, -1 at rest and 1 pressed.
        dead_zone: of the stick, from 0 to 1.
        slew_per_s: fastest turn of the wheel, in wheel units of [-2.5, 2.5] a second.
    """

    stick_axis: int = 0
    throttle_axis: int = 5
    brake_axis: int = 2
    dead_zone: float = 0.1
    slew_per_s: float = 8.0
    pause_button: int = 7
    redo_button: int = 6
    take_over_button: int = 5

    def __post_init__(self) -> None:
        if not 0.0 <= self.dead_zone < 1.0:
            raise InvalidConfig(f"dead_zone is {self.dead_zone}; give one from 0 to below 1.")
        if not self.slew_per_s > 0.0:
            raise InvalidConfig(f"slew_per_s is {self.slew_per_s}; it must be positive.")


class GamepadDevice:
    """A gamepad's stick; its position is unknown until it first moves.

    Args:
        name: part of a name, or a GUID; needed when several pads are plugged in.
        now_ns: the clock of the slew limit; tests pass their own.
    """

    def __init__(
        self,
        events: SdlEvents,
        config: GamepadConfig | None = None,
        *,
        name: str = "",
        now_ns: Callable[[], int] = perf_counter_ns,
    ) -> None:
        self._events = events
        self._config = config or GamepadConfig()
        self._name = name
        self._now_ns = now_ns
        self._joystick: RawJoystick | None = None
        self._wheel = 0.0
        self._at_ns = 0

    @property
    def info(self) -> DeviceInfo:
        """Name and limits; before ``connect`` only what was asked for."""
        details = {name: f"{value:g}" for name, value in vars(self._config).items()}
        if self._joystick is None:
            name = self._name or "a gamepad"
            return DeviceInfo(kind=InputKind.GAMEPAD, name=name, details=details)
        pad = self._joystick.info
        return DeviceInfo(
            kind=InputKind.GAMEPAD,
            name=pad.name,
            guid=pad.guid,
            buttons=frozenset((Button.PAUSE, Button.REDO, Button.TAKE_OVER)),
            details=details,
        )

    def connect(self) -> None:
        """Find and open the pad.

        Raises:
            DeviceError: there is none, there are several, or it is a steering wheel.
        """
        if self._joystick is not None:
            return
        profiles = [*user_profiles(), *shipped_profiles()]
        joysticks = list_joysticks()

        def is_wheel(joystick: JoystickInfo) -> bool:
            return find_profile(joystick, profiles, this_system()) is not None

        pads = joysticks if self._name else [pad for pad in joysticks if not is_wheel(pad)]
        pad = choose_joystick(pads, self._name, "gamepad")
        if is_wheel(pad):
            raise DeviceError(f"{pad} is a steering wheel; use it as wheel:{pad.name}.")
        if pad.axes <= self._config.stick_axis:
            raise DeviceError(f"{pad} has {pad.axes} axes, no stick; name another gamepad.")
        joystick = RawJoystick(self._events, pad)
        joystick.open()
        self._joystick = joystick
        self._centre()

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Centre the wheel; it follows the stick from there."""
        self._centre()

    def read(self, step: int | None = None) -> DeviceSample:
        """The wheel, moved towards the stick at the limited rate."""
        if self._joystick is None:
            return DeviceSample(wheel=None, ok=False)
        raw = self._joystick.raw()
        stick = None if raw.lost else raw.axes[self._config.stick_axis]
        if stick is None:
            self._centre()
            return DeviceSample(wheel=None, t_event_ns=raw.t_event_ns, ok=False)
        now_ns = self._now_ns()
        reach = self._config.slew_per_s * (now_ns - self._at_ns) / 1e9
        self._at_ns = now_ns
        self._wheel += min(reach, max(-reach, self._target(stick) - self._wheel))
        return DeviceSample(
            wheel=self._wheel,
            throttle=self._trigger(raw, self._config.throttle_axis),
            brake=self._trigger(raw, self._config.brake_axis),
            buttons=self._buttons(raw),
            t_event_ns=raw.t_event_ns,
        )

    def disconnect(self) -> None:
        """Close it; calling it again does nothing."""
        if self._joystick is not None:
            self._joystick.close()
            self._joystick = None

    def _centre(self) -> None:
        self._wheel, self._at_ns = 0.0, self._now_ns()

    def _target(self, stick: float) -> float:
        beyond = max(0.0, abs(stick) - self._config.dead_zone) / (1.0 - self._config.dead_zone)
        return WHEEL_LIMIT * beyond * (1.0 if stick < 0.0 else -1.0)

    def _trigger(self, raw: RawSample, axis: int) -> float | None:
        value = raw.axes[axis] if axis < len(raw.axes) else None
        return None if value is None else (value + 1.0) / 2.0

    def _buttons(self, raw: RawSample) -> frozenset[Button]:
        config = self._config
        numbers = {
            config.pause_button: Button.PAUSE,
            config.redo_button: Button.REDO,
            config.take_over_button: Button.TAKE_OVER,
        }
        return frozenset(numbers[number] for number in raw.buttons if number in numbers)
