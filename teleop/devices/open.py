"""Opens the device that a command-line argument names: ``wheel:G29``, ``scripted:human:3``."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import get_args

from steerlab.sim.errors import shown
from steerlab.sim.populations import LONGEST_SEED, PopulationKind, sample_population
from steerlab.teleop.devices.contract import Device, DeviceError
from steerlab.teleop.devices.force_feedback import (
    DEFAULT_AUTOCENTRE,
    ForceFeedback,
    open_force_feedback,
)
from steerlab.teleop.devices.gamepad import GamepadDevice
from steerlab.teleop.devices.joystick import JoystickInfo
from steerlab.teleop.devices.keyboard import KeyboardDevice
from steerlab.teleop.devices.mouse import MouseDevice
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.devices.trace import read_trace
from steerlab.teleop.devices.wheel import OpenFeedback, WheelDevice
from steerlab.teleop.sdl import SdlEvents

_KINDS: tuple[str, ...] = get_args(PopulationKind)
DEVICE_SPECS = (
    "wheel",
    "wheel:NAME",
    "gamepad",
    "gamepad:NAME",
    "keyboard",
    "mouse",
    "scripted:KIND:SEED",
    "trace:FILE",
)
"""The forms that ``open_device`` accepts."""


def open_device(
    spec: str, events: SdlEvents | None = None, *, autocentre: float | None = DEFAULT_AUTOCENTRE
) -> Device:
    """The device that ``spec`` names, still to be connected; never another in its place.

    Args:
        spec: one of ``DEVICE_SPECS``.
        events: the open event queue; scripts and traces need none.
        autocentre: a wheel's centring force, 0 to 1, if it has a motor; None leaves it alone.

    Raises:
        DeviceError: ``spec`` names no device, or what it names cannot be read.
    """
    kind, _, rest = spec.partition(":")
    if kind == "scripted":
        return _scripted(spec, rest)
    if kind == "trace" and rest:
        return read_trace(Path(os.path.expanduser(rest)))  # no shell does it after a colon
    makers: dict[str, Callable[[SdlEvents], Device]] = {
        "wheel": lambda queue: WheelDevice(
            queue, name=rest, open_feedback=None if autocentre is None else _feedback(autocentre)
        ),
        "gamepad": lambda queue: GamepadDevice(queue, name=rest),
        "keyboard": KeyboardDevice,
        "mouse": MouseDevice,
    }
    if kind not in makers or (rest and kind in ("keyboard", "mouse")) or spec.endswith(":"):
        raise DeviceError(f"No device {shown(spec)}; choose one of {', '.join(DEVICE_SPECS)}.")
    if events is None:
        raise DeviceError(f"{spec!r} needs SDL's event queue; open SdlEvents first.")
    return makers[kind](events)


def _feedback(autocentre: float) -> OpenFeedback:
    def open_it(wheel: JoystickInfo) -> ForceFeedback:
        return open_force_feedback(wheel.vendor, wheel.product, autocentre=autocentre)

    return open_it


def _scripted(spec: str, rest: str) -> ScriptedDevice:
    for kind in get_args(PopulationKind):
        seed = rest.removeprefix(f"{kind}:")
        if seed != rest and seed.isascii() and seed.isdecimal() and len(seed) <= LONGEST_SEED:
            (teacher,) = sample_population(kind, 1, int(seed), prefix="scripted")
            return ScriptedDevice(teacher)
    raise DeviceError(
        f"No scripted teacher {shown(spec)}; give scripted:KIND:SEED with a KIND of "
        f"{', '.join(_KINDS)} and a SEED from 0 of at most {LONGEST_SEED} digits, such as scripted:human:3."
    )
