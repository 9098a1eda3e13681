"""Force feedback on Linux through evdev: a centring force, and a spring for the practice drive.

pygame has none. It is optional in every respect: without the package, the permission or the
motor it is off, and the reason is kept with the session.
"""

import importlib
import logging
from pathlib import Path
from typing import Any

from steerlab.teleop.devices.profile import this_system

DEFAULT_AUTOCENTRE = 0.3  # of the motor's strength: a light pull, the same for everyone
_FULL = 0xFFFF  # of FF_AUTOCENTER and saturations
_FULL_SLOPE = 0x7FFF  # of a condition's coefficients
_log = logging.getLogger(__name__)


class ForceFeedback:
    """One wheel's motor; its settings drop when the file closes, so it stays open.

    Attributes:
        text: what is on with its strength, or ``off: why``.
    """

    def __init__(self, text: str, device: Any = None, evdev: Any = None) -> None:
        self.text = text
        self._device = device
        self._evdev = evdev
        self._spring_id: int | None = None

    def spring(self, strength: float) -> str:
        """Pull to the centre in proportion to the angle, as a road wheel does; 0 to 1.

        Returns:
            What is on, or ``off: why``.
        """
        device = self._device
        if device is None:
            return self.text
        codes = self._evdev.ecodes
        if codes.FF_SPRING not in device.capabilities().get(codes.EV_FF, ()):
            return "off: the wheel has no spring"
        try:
            if self._spring_id is not None:
                device.erase_effect(self._spring_id)
                self._spring_id = None
            self._spring_id = device.upload_effect(_spring(self._evdev, strength))
            device.write(codes.EV_FF, self._spring_id, 1)
        except OSError as error:
            return f"off: the wheel refused the spring ({error.strerror})"
        return f"spring {strength:.2f}"

    def close(self) -> None:
        """Switch the forces off, as the driver does at start; calling it again does nothing."""
        if self._device is None:
            return
        device, self._device = self._device, None
        codes = self._evdev.ecodes
        try:
            if self._spring_id is not None:
                device.erase_effect(self._spring_id)
            device.write(codes.EV_FF, codes.FF_AUTOCENTER, 0)
        except OSError as error:  # unplugged: its forces are gone with it
            _log.info("force feedback was not reset: %s", error)
        device.close()
        self.text = "off: closed"


def open_force_feedback(
    vendor: int,
    product: int,
    *,
    autocentre: float = DEFAULT_AUTOCENTRE,
    evdev: Any = None,
    inputs: Path = Path("/sys/class/input"),
    system: str | None = None,
) -> ForceFeedback:
    """Switch on a fixed centring force; if that fails, the result's ``text`` says why.

    Args:
        vendor, product: USB numbers of the wheel; the first device with a motor may be another.
        autocentre: strength from 0 to 1.
        evdev: the package; imported by default.
        inputs: where the kernel lists input devices, readable by everyone.
    """
    if (system or this_system()) != "linux":
        return ForceFeedback("off: force feedback needs Linux")
    names = [name for name in _event_names(inputs) if _ids(inputs / name) == (vendor, product)]
    if not names:
        return ForceFeedback(f"off: no input device {vendor:04x}:{product:04x}")
    if evdev is None:
        try:
            evdev = importlib.import_module("evdev")
        except ModuleNotFoundError:
            return ForceFeedback("off: evdev is missing (pip install 'steerlab[force-feedback]')")
    why = "off: the wheel has no centring motor"
    for name in names:
        try:
            device = evdev.InputDevice(f"/dev/input/{name}")
        except PermissionError:
            why = f"off: no permission for /dev/input/{name}; join the group 'input', log in again"
            continue
        except OSError as error:
            why = f"off: /dev/input/{name} does not open ({error.strerror})"
            continue
        codes = evdev.ecodes
        if codes.FF_AUTOCENTER in device.capabilities().get(codes.EV_FF, ()):
            try:
                device.write(codes.EV_FF, codes.FF_AUTOCENTER, round(autocentre * _FULL))
            except OSError as error:
                why = f"off: /dev/input/{name} refused the centring force ({error.strerror})"
            else:
                return ForceFeedback(f"autocentre {autocentre:.2f}", device, evdev)
        device.close()
    return ForceFeedback(why)


def _event_names(inputs: Path) -> list[str]:
    return sorted(path.name for path in inputs.glob("event*"))


def _ids(event: Path) -> tuple[int, int] | None:
    try:
        vendor, product = (
            (event / "device/id" / name).read_text(encoding="ascii") for name in _ID_FILES
        )
    except OSError:
        return None  # no USB device, such as a power button
    return int(vendor, 16), int(product, 16)


_ID_FILES = ("vendor", "product")


def _spring(evdev: Any, strength: float) -> Any:
    """An ``FF_SPRING`` effect of unlimited length around the centre, for the steering axis."""
    ff = evdev.ff
    slope = round(strength * _FULL_SLOPE)
    force = ff.Condition(_FULL, _FULL, slope, slope, 0, 0)
    conditions = (ff.Condition * 2)(force, ff.Condition())
    effect = ff.EffectType(ff_condition_effect=conditions)
    return ff.Effect(
        evdev.ecodes.FF_SPRING, -1, 0, ff.Trigger(0, 0), ff.Replay(0, 0), effect
    )  # a length of 0 has no end
