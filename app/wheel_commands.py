"""What ``steerlab wheel list``, ``calibrate`` and ``test`` do; nothing here prints."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter_ns, sleep

from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Device, DeviceSample
from steerlab.teleop.devices.joystick import (
    JoystickInfo,
    RawJoystick,
    choose_joystick,
    list_joysticks,
)
from steerlab.teleop.devices.measuring import WizardConfig
from steerlab.teleop.devices.profile import this_system
from steerlab.teleop.devices.profile_folder import (
    StoredProfile,
    find_profile,
    shipped_profiles,
    sound_profiles,
)
from steerlab.teleop.devices.wizard import run_wizard
from steerlab.teleop.screen.contract import Act, Page, Screen
from steerlab.teleop.sdl import SdlEvents

NONE_FOUND = "No joystick, wheel or gamepad is plugged in."
_CENTRE_BAND = 0.15
_BAR = 41  # characters of the textual wheel, odd so that it has a middle


@dataclass(frozen=True, kw_only=True)
class FoundWheel:
    """A joystick that is plugged in, and the profile that fits it; None if there is none."""

    joystick: JoystickInfo
    stored: StoredProfile | None

    @property
    def calibrated(self) -> bool:
        """Whether it may give labels: a calibrated profile fits it."""
        return self.stored is not None and self.stored.profile.calibrated

    def to_dict(self) -> dict[str, object]:
        """For ``--json``."""
        device, stored = self.joystick, self.stored
        return {
            "name": device.name,
            "guid": device.guid,
            "vendor": f"{device.vendor:04x}",
            "product": f"{device.product:04x}",
            "axes": device.axes,
            "buttons": device.buttons,
            "calibrated": self.calibrated,
            "profile": None if stored is None else stored.profile.name,
            "profile_file": None if stored is None else stored.file,
        }


def find_wheels(events: SdlEvents, folder: Path | None = None) -> list[FoundWheel]:
    """All joysticks with axes that are plugged in; of the user's profiles those that can be read.

    Raises:
        DeviceError: several profiles fit one of them.
    """
    events.poll()
    profiles = [*sound_profiles(folder)[0], *shipped_profiles()]
    return [
        FoundWheel(joystick=joystick, stored=find_profile(joystick, profiles, this_system()))
        for joystick in list_joysticks()
    ]


def list_lines(wheels: list[FoundWheel]) -> list[str]:
    """``steerlab wheel list``, a line or two for each."""
    lines: list[str] = []
    for wheel in wheels:
        device, stored = wheel.joystick, wheel.stored
        lines.append(
            f"{device.name}  {device.vendor:04x}:{device.product:04x}  {device.axes} axes, "
            f"{device.buttons} buttons  guid {device.guid}"
        )
        if wheel.calibrated and stored is not None:
            lines.append(f"  calibrated: {stored.file}")
        elif stored is not None:
            lines.append(f"  {stored.profile.name}, not calibrated; run: steerlab wheel calibrate")
        else:
            lines.append("  unknown; if it is a wheel, run: steerlab wheel calibrate")
    return lines or [NONE_FOUND]


def calibrate_wheel(
    screen: Screen,
    events: SdlEvents,
    *,
    name: str = "",
    folder: Path | None = None,
    config: WizardConfig | None = None,
    now_ns: Callable[[], int] = perf_counter_ns,
    sleep_s: Callable[[float], None] = sleep,
) -> Path | None:
    """``steerlab wheel calibrate``: the wizard for the joystick that ``name`` fits.

    Returns:
        The profile's file, or None if the person stopped.

    Raises:
        DeviceError: no joystick fits, or several do.
    """
    events.poll()
    device = choose_joystick(list_joysticks(), name, "wheel")
    known = find_profile(device, shipped_profiles(), this_system())
    joystick = RawJoystick(events, device)
    joystick.open()
    try:
        return run_wizard(
            screen,
            events,
            joystick,
            name=device.name if known is None else known.profile.name,
            folder=folder,
            config=config,
            now_ns=now_ns,
            sleep_s=sleep_s,
        )
    finally:
        joystick.close()


def live_page(device: Device, sample: DeviceSample) -> Page:
    """The live view of a connected device."""
    if sample.ok:
        lines = [f"Wheel {sample.wheel:+.2f} of ±{WHEEL_LIMIT}, positive to the left."]
    else:
        lines = ["Nothing is known yet: turn the wheel a little, or plug it in."]
    if sample.buttons:
        lines.append("Buttons: " + ", ".join(sorted(sample.buttons)))
    pedals = [("throttle", sample.throttle), ("brake", sample.brake)]
    return Page(
        title=device.info.name,
        lines=lines,
        keys=[("Esc", "stop")],
        tone="neutral" if sample.ok else "warning",
        needle=sample.wheel,
        centre_band=_CENTRE_BAND,
        bars=pedals,
    )


def watch_on_screen(
    screen: Screen,
    events: SdlEvents,
    device: Device,
    *,
    sleep_s: Callable[[float], None] = sleep,
) -> None:
    """``steerlab wheel test``: needle and bars until the person stops; ``device`` is connected."""
    while True:
        events.poll()
        if Act.STOP in screen.acts():
            return
        screen.show_page(live_page(device, device.read()))
        sleep_s(1.0 / 60.0)


def watch_lines(
    events: SdlEvents,
    device: Device,
    *,
    rate_hz: float = 10.0,
    sleep_s: Callable[[float], None] = sleep,
) -> Iterator[str]:
    """``steerlab wheel test --text``: a line every now and then, without end, for a terminal."""
    while True:
        for _ in range(max(1, round(100.0 / rate_hz))):
            events.poll()
            sleep_s(0.01)
        yield text_view(device.read())


def text_view(sample: DeviceSample) -> str:
    """A sample as one line: the wheel as a bar seen from the driver's seat, left is left."""
    if sample.wheel is None:
        return f"[{'?' * _BAR}] wheel unknown: turn it a little, or plug it in"
    middle = _BAR // 2
    at = round(middle - sample.wheel / WHEEL_LIMIT * middle)
    bar = "".join("O" if i == at else "|" if i == middle else "-" for i in range(_BAR))
    pedals = "".join(
        f"  {name} {'?' if value is None else f'{value:.2f}'}"
        for name, value in (("throttle", sample.throttle), ("brake", sample.brake))
    )
    held = f"  {', '.join(sorted(sample.buttons))}" if sample.buttons else ""
    return f"[{bar}] {sample.wheel:+.2f}{pedals}{held}{'' if sample.ok else '  NOT OK'}"
