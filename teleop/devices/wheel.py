"""A steering wheel, read through the profile that the wizard measured for it."""

import platform
from collections.abc import Callable, Sequence

from steerlab.sim.rollout import Rollout
from steerlab.teleop.devices.contract import (
    DeviceError,
    DeviceInfo,
    DeviceSample,
    InputKind,
)
from steerlab.teleop.devices.force_feedback import ForceFeedback
from steerlab.teleop.devices.joystick import (
    JoystickInfo,
    RawJoystick,
    RawSample,
    choose_joystick,
    list_joysticks,
)
from steerlab.teleop.devices.profile import PedalAxis, WheelProfile, this_system
from steerlab.teleop.devices.profile_folder import (
    StoredProfile,
    find_profile,
    shipped_profiles,
    user_profiles,
)
from steerlab.teleop.sdl import SdlEvents

CALIBRATE = "run: steerlab wheel calibrate"
OpenFeedback = Callable[[JoystickInfo], ForceFeedback]


def read_wheel(profile: WheelProfile, raw: RawSample) -> DeviceSample:
    """Wheel, pedals and buttons from raw axes; what is unknown stays unknown."""
    if raw.lost:
        return DeviceSample(wheel=None, t_event_ns=raw.t_event_ns, ok=False)
    steering = raw.axes[profile.steering.axis]
    names = {number: button for button, number in profile.buttons.items()}
    return DeviceSample(
        wheel=None if steering is None else profile.steering.wheel(steering),
        throttle=_pedal(profile.throttle, raw),
        brake=_pedal(profile.brake, raw),
        buttons=frozenset(names[number] for number in raw.buttons if number in names),
        t_event_ns=raw.t_event_ns,
        ok=steering is not None,
    )


class WheelDevice:
    """A wheel that was calibrated; no other device ever takes its place.

    Args:
        events: the event queue it listens to; the loop polls it.
        name: part of a name, or a GUID; needed when several calibrated wheels are plugged in.
        profiles: where to look for its profile; shipped and the user's own by default.
        open_feedback: opens its force feedback; None leaves that alone.
    """

    def __init__(
        self,
        events: SdlEvents,
        *,
        name: str = "",
        profiles: Sequence[StoredProfile] | None = None,
        open_feedback: OpenFeedback | None = None,
        system: str | None = None,
    ) -> None:
        self._events = events
        self._name = name
        self._profiles = profiles
        self._open_feedback = open_feedback
        self._system = system or this_system()
        self._joystick: RawJoystick | None = None
        self._stored: StoredProfile | None = None
        self._feedback: ForceFeedback | None = None
        self._feedback_openings = 0

    @property
    def info(self) -> DeviceInfo:
        """Name and layout; before ``connect`` only what was asked for."""
        if self._joystick is None or self._stored is None:
            return DeviceInfo(kind=InputKind.WHEEL, name=self._name or "a wheel")
        device, profile = self._joystick.info, self._stored.profile
        details = {
            "vendor": f"{device.vendor:04x}",
            "product": f"{device.product:04x}",
            "axes": str(device.axes),
            "os": f"{platform.system()} {platform.release()}",
            "profile": profile.name,
            "dead_zone_raw": f"{profile.steering.dead_zone:.5f}",
        }
        if profile.measured is not None:
            measured = profile.measured
            details["resolution"] = f"{measured.resolution:.5f}"
            details["rate_hz"] = f"{measured.rate_hz:.0f}"
            details["noise"] = f"{measured.noise:.5f}"
            details["return_error"] = f"{measured.return_error:.5f}"
        feedback = self._feedback
        return DeviceInfo(
            kind=InputKind.WHEEL,
            name=device.name,
            guid=device.guid,
            profile_sha256=self._stored.sha256,
            force_feedback="off: not asked for" if feedback is None else feedback.text,
            buttons=frozenset(profile.buttons),
            details=details,
        )

    @property
    def force_feedback(self) -> ForceFeedback | None:
        """Its force feedback while connected; None if that was not asked for."""
        return self._feedback

    def connect(self) -> None:
        """Find the wheel and its profile, and open both.

        Raises:
            DeviceError: no wheel, several, or one that was not calibrated.
        """
        if self._joystick is not None:
            return
        profiles = self._profiles
        if profiles is None:
            profiles = [*user_profiles(), *shipped_profiles()]
        device = self._choose(list_joysticks(), profiles)
        stored = find_profile(device, profiles, self._system)
        if stored is None or not stored.profile.calibrated:
            known = "unknown here" if stored is None else f"known as {stored.profile.name}"
            raise DeviceError(f"{device} is {known}, but was not calibrated; {CALIBRATE}")
        if stored.profile.match.axes != device.axes:
            raise DeviceError(
                f"{device} has {device.axes} axes now, {stored.profile.match.axes} when it was "
                f"calibrated; another driver or mode? Change it back, or {CALIBRATE}"
            )
        joystick = RawJoystick(self._events, device)
        joystick.open()
        self._joystick, self._stored = joystick, stored
        self._open_force_feedback()

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Restore the force feedback of a wheel that was unplugged in between."""
        if self._joystick is not None and self._joystick.openings != self._feedback_openings:
            self._open_force_feedback()

    def read(self, step: int | None = None) -> DeviceSample:
        """Its state as of the last poll; ``ok`` only when plugged in and turned at least once."""
        if self._joystick is None or self._stored is None:
            return DeviceSample(wheel=None, ok=False)
        return read_wheel(self._stored.profile, self._joystick.raw())

    def disconnect(self) -> None:
        """Close it, and its force feedback; calling it again does nothing."""
        if self._feedback is not None:
            self._feedback.close()
        if self._joystick is not None:
            self._joystick.close()
        self._joystick = self._stored = self._feedback = None

    def _open_force_feedback(self) -> None:
        if self._joystick is None or self._open_feedback is None:
            return
        if self._feedback is not None:
            self._feedback.close()
        self._feedback = self._open_feedback(self._joystick.info)
        self._feedback_openings = self._joystick.openings

    def _choose(
        self, joysticks: list[JoystickInfo], profiles: Sequence[StoredProfile]
    ) -> JoystickInfo:
        """The wheel that was named, or else the only one; calibrated wheels go before others."""
        if self._name:
            return choose_joystick(joysticks, self._name, "wheel")
        wheels: list[JoystickInfo] = []
        calibrated: list[JoystickInfo] = []
        for joystick in joysticks:
            stored = find_profile(joystick, profiles, self._system)
            if stored is not None:
                wheels.append(joystick)
                if stored.profile.calibrated:
                    calibrated.append(joystick)
        if joysticks and not wheels:
            raise DeviceError(
                f"None of {', '.join(map(str, joysticks))} was calibrated as a wheel; {CALIBRATE}"
            )
        return choose_joystick(calibrated or wheels, "", "wheel")


def _pedal(pedal: PedalAxis | None, raw: RawSample) -> float | None:
    if pedal is None:
        return None
    value = raw.axes[pedal.axis]
    return None if value is None else pedal.amount(value)
