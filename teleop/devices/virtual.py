"""A joystick without hardware: SDL's own virtual joystick, which pygame takes for a real one.

For tests, benchmarks and ``doctor --loop``: unlike a recorded trace it goes through SDL's driver,
its event queue and all that pygame does.
"""

import ctypes
import re
from pathlib import Path
from types import TracebackType

from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.sdl import pygame

LOGITECH = 0x046D
G920 = 0xC262
WHEEL = 2  # SDL_JOYSTICK_TYPE_WHEEL
GAMEPAD = 1  # SDL_JOYSTICK_TYPE_GAMECONTROLLER
_AXIS_MAX = 32767


class _Desc(ctypes.Structure):
    """``SDL_VirtualJoystickDesc``, version 1 (SDL 2.24 and later)."""

    _fields_ = (
        *(
            (name, ctypes.c_uint16)
            for name in ("version", "type", "naxes", "nbuttons", "nhats", "vendor", "product")
        ),
        ("padding", ctypes.c_uint16),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        ("userdata", ctypes.c_void_p),
        *(
            (name, ctypes.c_void_p)
            for name in (
                "Update",
                "SetPlayerIndex",
                "Rumble",
                "RumbleTriggers",
                "SetLED",
                "SendEffect",
            )
        ),
    )


class VirtualJoystick:
    """Plugged in by ``with``, unplugged by ``unplug`` or at the end of the block.

    What is set takes effect when the event queue is next polled.

    Args:
        vendor, product: USB numbers; a Logitech G920's by default.
        kind: SDL's type: ``WHEEL`` or ``GAMEPAD``.
    """

    def __init__(
        self,
        *,
        name: str = "Virtual wheel",
        vendor: int = LOGITECH,
        product: int = G920,
        axes: int = 4,
        buttons: int = 14,
        kind: int = WHEEL,
    ) -> None:
        self.name = name
        self._desc = _Desc(
            version=1,
            type=kind,
            naxes=axes,
            nbuttons=buttons,
            vendor=vendor,
            product=product,
            name=name.encode(),
        )
        self._axes, self._buttons = axes, buttons
        self._instance: int | None = None

    def plug_in(self) -> None:
        """Attach it; pygame sees a new joystick.

        Raises:
            DeviceError: SDL is not running, or has no virtual joysticks.
        """
        if not pygame.joystick.get_init():
            raise DeviceError("SDL is not running; open SdlEvents before a virtual joystick.")
        self._sdl = mapped_sdl()
        index = self._sdl.SDL_JoystickAttachVirtualEx(ctypes.byref(self._desc))
        if index < 0:
            raise DeviceError(f"SDL makes no virtual joystick: {self._sdl_error()}.")
        self._instance = self._sdl.SDL_JoystickGetDeviceInstanceID(index)

    def axis(self, axis: int, value: float) -> None:
        """Put an axis to ``value`` in [-1, 1]."""
        if not -1.0 <= value <= 1.0:
            raise DeviceError(f"Axis {axis} cannot be at {value}; give a value from -1 to 1.")
        self.raw_axis(axis, round(value * _AXIS_MAX))

    def raw_axis(self, axis: int, value: int) -> None:
        """Put an axis to SDL's own number, from -32768 to 32767."""
        self._check("axis", axis, self._axes)
        self._set("SDL_JoystickSetVirtualAxis", axis, value)

    def button(self, button: int, down: bool) -> None:
        """Press or let go a button."""
        self._check("button", button, self._buttons)
        self._set("SDL_JoystickSetVirtualButton", button, int(down))

    def unplug(self) -> None:
        """Take it away; SDL says so at the next poll. Calling it again does nothing."""
        index = self._index()
        self._instance = None
        if index is not None:
            self._sdl.SDL_JoystickDetachVirtual(index)

    def __enter__(self) -> "VirtualJoystick":
        self.plug_in()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.unplug()

    def _set(self, function: str, number: int, value: int) -> None:
        """Set an axis or button; opened only meanwhile, as a real one closes with its last user."""
        handle = self._sdl.SDL_JoystickOpen(self._index())
        if not handle:
            raise DeviceError(f"SDL does not open its virtual joystick: {self._sdl_error()}.")
        getattr(self._sdl, function)(handle, number, value)
        self._sdl.SDL_JoystickClose(handle)

    def _index(self) -> int | None:
        """SDL's present index of it; None if it is not plugged in, or SDL closed with it."""
        if self._instance is None or not pygame.joystick.get_init():
            return None
        instances = map(
            self._sdl.SDL_JoystickGetDeviceInstanceID, range(self._sdl.SDL_NumJoysticks())
        )
        return next((i for i, instance in enumerate(instances) if instance == self._instance), None)

    def _check(self, what: str, number: int, count: int) -> None:
        if self._index() is None:
            raise DeviceError(f"{self.name!r} is not plugged in; call plug_in() first.")
        if not 0 <= number < count:
            raise DeviceError(f"{self.name!r} has no {what} {number}; it has {count}.")

    def _sdl_error(self) -> str:
        return self._sdl.SDL_GetError().decode(errors="replace") or "no reason given"


def mapped_sdl() -> ctypes.CDLL:
    """The SDL that pygame itself runs on; a second copy would have joysticks of its own."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="surrogateescape")
    except FileNotFoundError:
        raise DeviceError("Virtual joysticks need Linux: /proc/self/maps is missing.") from None
    paths = set(re.findall(r"(/\S*/libSDL2-2[.-]\S*)", maps))
    if len(paths) != 1:
        raise DeviceError(f"Expected one SDL library in this process, found {sorted(paths)}.")
    sdl = ctypes.CDLL(paths.pop())
    sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
    sdl.SDL_JoystickClose.argtypes = [ctypes.c_void_p]
    sdl.SDL_JoystickClose.restype = None
    sdl.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    sdl.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    sdl.SDL_GetError.restype = ctypes.c_char_p
    return sdl
