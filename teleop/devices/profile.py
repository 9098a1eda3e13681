"""How the raw axes of one wheel become a wheel position and pedals."""

import platform
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Literal, get_args

from steerlab.sim.errors import InvalidValue
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button

System = Literal["linux", "windows", "darwin"]
SYSTEMS: tuple[str, ...] = get_args(System)


def this_system() -> str:
    """``linux``, ``windows`` or ``darwin``: axes and their signs depend on the driver."""
    return platform.system().lower()


@dataclass(frozen=True, kw_only=True, slots=True)
class ProfileMatch:
    """Which device a profile is for.

    Attributes:
        guid: SDL's; empty if the profile is for a model, not for one driver's view of it.
        products: USB product numbers that share this layout.
        axes: how many the device has; 0 for any number, which only an uncalibrated one may have.
    """

    guid: str = ""
    vendor: int
    products: tuple[int, ...]
    axes: int = 0
    system: str = field(metadata={"key": "os"})

    def __post_init__(self) -> None:
        if self.guid and not re.fullmatch(r"[0-9a-f]{32}", self.guid):
            raise InvalidValue("guid", self.guid, "32 hexadecimal digits, or empty")
        if not 0 <= self.vendor <= 0xFFFF:
            raise InvalidValue("vendor", self.vendor, "a USB number from 0 to 0xffff")
        if not self.products or not all(0 <= product <= 0xFFFF for product in self.products):
            raise InvalidValue(
                "products", list(self.products), "one or more USB numbers up to 0xffff"
            )
        if not 0 <= self.axes <= 64:
            raise InvalidValue("axes", self.axes, "a number of axes from 0 to 64")
        if self.system not in SYSTEMS:
            raise InvalidValue("os", self.system, f"one of {', '.join(SYSTEMS)}")


@dataclass(frozen=True, kw_only=True, slots=True)
class SteeringAxis:
    """The steering axis; raw values are in [-1, 1].

    Attributes:
        sign: 1 if the raw value grows to the left, -1 if it grows to the right.
        minimum, maximum: raw values at the two ends, which become -2.5 and 2.5 or the reverse.
        centre: raw value of the straight wheel.
        dead_zone: half the band around the centre that counts as centred, raw.
    """

    axis: int
    sign: int
    minimum: float = -1.0
    centre: float = 0.0
    maximum: float = 1.0
    dead_zone: float = 0.0

    def __post_init__(self) -> None:
        _check_axis("axis", self.axis)
        if self.sign not in (-1, 1):
            raise InvalidValue("sign", self.sign, "1 (grows to the left) or -1")
        for name in ("minimum", "centre", "maximum"):
            _check_raw(name, getattr(self, name))
        if not self.minimum < self.centre < self.maximum:
            raise InvalidValue(
                "centre",
                self.centre,
                f"between minimum {self.minimum:g} and maximum {self.maximum:g}",
            )
        nearest = min(self.maximum - self.centre, self.centre - self.minimum)
        if not 0.0 <= self.dead_zone <= 0.5 * nearest:
            raise InvalidValue(
                "dead_zone", self.dead_zone, f"from 0 to half of one side, {nearest / 2:g}"
            )

    def wheel(self, raw: float) -> float:
        """Wheel position in [-2.5, 2.5], positive left: 0 in the dead zone, linear beyond it."""
        off = raw - self.centre
        side = (self.maximum - self.centre) if off > 0.0 else (self.centre - self.minimum)
        beyond = max(0.0, abs(off) - self.dead_zone)
        share = min(1.0, beyond / (side - self.dead_zone))
        return WHEEL_LIMIT * share * (self.sign if off > 0.0 else -self.sign)


@dataclass(frozen=True, kw_only=True, slots=True)
class PedalAxis:
    """A pedal; its polarity is in the order of ``rest`` and ``pressed``, raw values in [-1, 1]."""

    axis: int
    rest: float
    pressed: float

    def __post_init__(self) -> None:
        _check_axis("axis", self.axis)
        _check_raw("rest", self.rest)
        _check_raw("pressed", self.pressed)
        if abs(self.pressed - self.rest) < 0.05:
            raise InvalidValue("pressed", self.pressed, f"0.05 or more from rest {self.rest:g}")

    def amount(self, raw: float) -> float:
        """0 at rest (and beyond), 1 when pressed."""
        return min(1.0, max(0.0, (raw - self.rest) / (self.pressed - self.rest)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Measured:
    """What the wizard measured, in wheel units of [-2.5, 2.5].

    Attributes:
        resolution: smallest difference between two readings seen.
        rate_hz: axis events a second while the wheel turned.
        noise: standard deviation of the released wheel.
        return_error: between two places where the released wheel came to rest.
    """

    resolution: float
    rate_hz: float
    noise: float
    return_error: float

    def __post_init__(self) -> None:
        for name in ("resolution", "rate_hz", "noise", "return_error"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise InvalidValue(name, value, "a number that is not negative")


@dataclass(frozen=True, kw_only=True)
class WheelProfile:
    """One wheel's layout; only a calibrated one may give labels.

    Attributes:
        combined_pedals: both pedals move one axis, to either side of its rest.
        measured: by the wizard; None in a profile that is a starting point only.
    """

    name: str
    match: ProfileMatch
    steering: SteeringAxis
    throttle: PedalAxis | None = None
    brake: PedalAxis | None = None
    combined_pedals: bool = False
    buttons: Mapping[Button, int] = field(default_factory=dict)
    measured: Measured | None = None
    calibrated: bool = False

    def __post_init__(self) -> None:
        if not self.name.strip() or not self.name.isprintable():
            raise InvalidValue("name", self.name, "a printable text that is not blank")
        self._check_pedals()
        for button, number in self.buttons.items():
            if number < 0:
                raise InvalidValue(f"buttons.{button}", number, "a button's number, from 0")
        if len(set(self.buttons.values())) < len(self.buttons):
            raise InvalidValue("buttons", dict(self.buttons), "a different number for each")
        if self.calibrated and (self.measured is None or self.match.axes == 0):
            raise InvalidValue(
                "calibrated", True, "false without match.axes and [measured], which the wizard adds"
            )

    def _check_pedals(self) -> None:
        axes = self.match.axes or 64
        for name in ("steering", "throttle", "brake"):
            part = getattr(self, name)
            if part is not None and part.axis >= axes:
                raise InvalidValue(f"{name}.axis", part.axis, f"below match.axes, {axes}")
            if name != "steering" and part is not None and part.axis == self.steering.axis:
                raise InvalidValue(f"{name}.axis", part.axis, "another axis than the steering's")
        throttle, brake = self.throttle, self.brake
        shared = throttle is not None and brake is not None and throttle.axis == brake.axis
        if shared != self.combined_pedals:
            raise InvalidValue(
                "combined_pedals", self.combined_pedals, f"{str(shared).lower()} with these axes"
            )
        if throttle is not None and brake is not None and shared:
            ways = (throttle.pressed - throttle.rest) * (brake.pressed - brake.rest)
            if ways > 0.0:
                raise InvalidValue(
                    "brake.pressed", brake.pressed, "on the other side of rest than the throttle's"
                )


def _check_axis(key: str, axis: int) -> None:
    if not 0 <= axis < 64:
        raise InvalidValue(key, axis, "an axis number from 0 to 63")


def _check_raw(key: str, value: float) -> None:
    if not (isfinite(value) and -1.0 <= value <= 1.0):
        raise InvalidValue(key, value, "a raw axis value from -1 to 1")
