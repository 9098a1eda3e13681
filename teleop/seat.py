"""Where a person sits: a device that is connected, before a window."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from steerlab.teleop.devices.contract import Device
from steerlab.teleop.devices.force_feedback import DEFAULT_AUTOCENTRE
from steerlab.teleop.devices.open import open_device
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import SdlEvents


@dataclass(frozen=True, kw_only=True, slots=True)
class Seat:
    """What whoever sits there looks at and holds."""

    events: SdlEvents
    device: Device
    screen: DriveScreen


@contextmanager
def seated(
    spec: str, screen: ScreenConfig, *, autocentre: float | None = DEFAULT_AUTOCENTRE
) -> Iterator[Seat]:
    """A seat for this block; device and window are closed at its end.

    Args:
        spec: of the device, as of ``open_device``.
        autocentre: a wheel's centring force, 0 to 1; None leaves it alone.

    Raises:
        SteerlabError: device or display cannot be used.
    """
    with SdlEvents(window=True) as events:
        device = open_device(spec, events, autocentre=autocentre)
        device.connect()
        try:
            with DriveScreen(events, screen) as window:
                yield Seat(events=events, device=device, screen=window)
        finally:
            device.disconnect()
