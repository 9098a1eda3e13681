"""What the calibration wizard concludes from raw samples, up to the profile: pure functions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button
from steerlab.teleop.devices.joystick import JoystickInfo, RawSample
from steerlab.teleop.devices.profile import (
    Measured,
    PedalAxis,
    ProfileMatch,
    SteeringAxis,
    WheelProfile,
)

Axes = Sequence[float | None]
_STANDSTILL_NS = 50_000_000  # a longer pause between events means that the wheel stood still


class Unclear(SteerlabError):
    """A measurement is inconclusive; the message tells the person what to do."""


@dataclass(frozen=True, kw_only=True)
class WizardConfig:
    """Limits that the wizard accepts; raw values are in [-1, 1].

    Attributes:
        rest_s: how long a released wheel is measured.
        min_travel: an axis that moves less is not the one asked for.
        max_shake: a released wheel that moves more was not released, as a share of one side.
        max_return_error: between two rests, as a share of one side.
        max_pedal_change: between two presses of a pedal, as a share of its travel.
        reached: of ±2.5 on the check screen.
        centre_band: what counts as centred there, in wheel units.
    """

    rest_s: float = 1.5
    min_travel: float = 0.2
    max_shake: float = 0.05
    max_return_error: float = 0.1
    max_pedal_change: float = 0.2
    reached: float = 2.45
    centre_band: float = 0.15

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0.0:
                raise InvalidConfig(f"WizardConfig.{name} is {value}; it must be positive.")


@dataclass(frozen=True, slots=True)
class AxisRest:
    """An axis that was left alone: median, standard deviation and largest departure, raw."""

    centre: float
    noise: float
    peak: float


@dataclass(frozen=True, slots=True)
class SteeringEnds:
    """The steering axis and its raw values at full left and full right."""

    axis: int
    left: float
    right: float

    @property
    def side(self) -> float:
        """Half of the whole span, raw."""
        return abs(self.left - self.right) / 2.0


def untouched(samples: Sequence[RawSample], config: WizardConfig) -> list[AxisRest | None]:
    """How each axis rests; None where it was unknown all along.

    Raises:
        Unclear: an axis moved, or was heard of for the first time.
    """
    rests: list[AxisRest | None] = []
    for readings in zip(*(sample.axes for sample in samples), strict=True):
        known = [value for value in readings if value is not None]
        rest = _rest(known) if len(known) == len(readings) else None
        if known and (rest is None or rest.peak > config.max_shake):
            raise Unclear("Something moved. Take hands and feet off, and try again.")
        rests.append(rest)
    return rests


def steering_ends(left: Axes, right: Axes, config: WizardConfig) -> SteeringEnds:
    """The axis with the largest span between the two ends.

    Raises:
        Unclear: none moved.
    """
    axis, travel = moved_most(left, right)
    at_left, at_right = (left[axis], right[axis]) if axis >= 0 else (None, None)
    if at_left is None or at_right is None or travel < config.min_travel:
        raise Unclear(
            "No axis moved between left and right. Turn the wheel itself, all the way to each "
            "side; if nothing moves at all, this may be the wrong device."
        )
    return SteeringEnds(axis, at_left, at_right)


def released_wheel(
    samples: Sequence[RawSample], ends: SteeringEnds, config: WizardConfig
) -> AxisRest:
    """Where the released wheel rests.

    Raises:
        Unclear: it moves, or rests far from the middle.
    """
    known = [value for sample in samples if (value := sample.axes[ends.axis]) is not None]
    rest = _rest(known) if len(known) == len(samples) else None
    if rest is None or rest.peak > config.max_shake * ends.side:
        raise Unclear("The wheel still moved. Let it go, and try again.")
    if abs(rest.centre - (ends.left + ends.right) / 2.0) > 0.6 * ends.side:
        raise Unclear("The wheel is not near the middle. Put it straight, and try again.")
    return rest


def pedal_axis(
    moments: Sequence[Axes], steering: int, throttle: PedalAxis | None, config: WizardConfig
) -> PedalAxis:
    """A pedal from two presses: ``moments`` are pressed, released, pressed, released.

    After the first two it may be asked whether anything moved at all.

    Args:
        throttle: what was found before, when this is the brake: it may share its axis.

    Raises:
        Unclear: no pedal moved, or the presses contradict each other.
    """
    presses, releases = moments[0::2], moments[1::2]
    moved = [
        moved_most(pressed, released, leave_out=(steering,))
        for pressed, released in zip(presses, releases, strict=True)
    ]
    if any(travel < config.min_travel for _, travel in moved):
        raise Unclear("No pedal moved. Press it all the way down, then release it.")
    axis = moved[0][0]
    downs = [value for press in presses if (value := press[axis]) is not None]
    ups = [value for release in releases if (value := release[axis]) is not None]
    if any(other != axis for other, _ in moved):
        raise Unclear("Another pedal moved the second time. Press the same one twice.")
    limit = config.max_pedal_change * abs(downs[0] - ups[0])
    if max(downs) - min(downs) > limit or max(ups) - min(ups) > limit:
        raise Unclear("The two presses differ. Press all the way down both times.")
    # The lesser press and the higher rest: both 0 and 1 are then reached every time.
    towards_rest, towards_press = (max, min) if downs[0] < ups[0] else (min, max)
    pedal = PedalAxis(axis=axis, rest=towards_press(ups), pressed=towards_rest(downs))
    if throttle is not None and throttle.axis == axis and same_way(throttle, pedal):
        raise Unclear("That is the throttle again. Press the brake.")
    return pedal


def same_way(first: PedalAxis, second: PedalAxis) -> bool:
    """Whether both pedals push their axis to the same side."""
    return (first.pressed - first.rest) * (second.pressed - second.rest) > 0.0


def moved_most(before: Axes, after: Axes, *, leave_out: Iterable[int] = ()) -> tuple[int, float]:
    """The axis that differs most between two moments, and by how much; (-1, 0) if none does."""
    best, most = -1, 0.0
    for axis, (start, end) in enumerate(zip(before, after, strict=True)):
        if start is None or end is None or axis in leave_out:
            continue
        if abs(end - start) > most:
            best, most = axis, abs(end - start)
    return best, most


class Motion:
    """Measures the axes' resolution and event rate while the wheel turns."""

    def __init__(self, axes: int) -> None:
        self._values: list[set[float]] = [set() for _ in range(axes)]
        self._last: RawSample | None = None
        self._events = 0
        self._time_ns = 0

    def add(self, sample: RawSample) -> None:
        """Take one sample; frequent calls measure better."""
        for seen, value in zip(self._values, sample.axes, strict=True):
            if value is not None:
                seen.add(value)
        now_ns, last = sample.t_event_ns, self._last
        before_ns = None if last is None else last.t_event_ns
        if now_ns == before_ns:
            return
        if last is not None and before_ns is not None and now_ns is not None:
            gap_ns = now_ns - before_ns
            if gap_ns <= _STANDSTILL_NS:
                self._events += sample.motions - last.motions
                self._time_ns += gap_ns
        self._last = sample

    def resolution(self, axis: int) -> float:
        """Smallest difference between two readings, raw; 2, the whole range, without two."""
        return min((b - a for a, b in pairwise(sorted(self._values[axis]))), default=2.0)

    @property
    def rate_hz(self) -> float:
        """Axis events a second while there were any; 0 without two in a row."""
        return self._events / (self._time_ns / 1e9) if self._time_ns else 0.0


def _rest(values: Sequence[float]) -> AxisRest:
    array = np.array(values)
    centre = float(np.median(array))
    return AxisRest(centre, float(array.std()), float(np.abs(array - centre).max()))


def measured_profile(
    joystick: JoystickInfo,
    *,
    system: str,
    name: str,
    ends: SteeringEnds,
    rests: tuple[AxisRest, AxisRest],
    motion: Motion,
    throttle: PedalAxis | None,
    brake: PedalAxis | None,
    buttons: Mapping[Button, int],
) -> WheelProfile:
    """The calibrated profile; raw measures become wheel units.

    Args:
        rests: two measurements of where the released wheel came to rest.
    """
    first, second = rests
    error = abs(first.centre - second.centre)
    to_wheel = WHEEL_LIMIT / ends.side
    shared = throttle is not None and brake is not None and throttle.axis == brake.axis
    return WheelProfile(
        name=name,
        match=ProfileMatch(
            guid=joystick.guid,
            vendor=joystick.vendor,
            products=(joystick.product,),
            axes=joystick.axes,
            system=system,
        ),
        steering=SteeringAxis(
            axis=ends.axis,
            sign=1 if ends.left > ends.right else -1,
            minimum=min(ends.left, ends.right),
            centre=(first.centre + second.centre) / 2.0,
            maximum=max(ends.left, ends.right),
            dead_zone=error / 2.0 + max(first.peak, second.peak),  # wherever it rests, it reads 0
        ),
        throttle=throttle,
        brake=brake,
        combined_pedals=shared,
        buttons=dict(buttons),
        measured=Measured(
            resolution=motion.resolution(ends.axis) * to_wheel,
            rate_hz=motion.rate_hz,
            noise=max(first.noise, second.noise) * to_wheel,
            return_error=error * to_wheel,
        ),
        calibrated=True,
    )
