"""``steerlab wheel``: steering wheels, listed, calibrated, tested."""

import sys
from typing import Annotated, Literal

import tyro

from steerlab.app.commands.arguments import Json, Name, Size, screen_config
from steerlab.app.commands.printing import print_json


def wheel(
    act: Annotated[
        tyro.conf.Positional[Literal["list", "calibrate", "test"]], tyro.conf.arg(metavar="ACT")
    ],
    name: Name = "",
    text: Annotated[bool, tyro.conf.arg(help="test: in the terminal, without a window.")] = False,
    size: Size = "960x540",
    json: Json = False,
) -> int:
    """Steering wheels: list what is plugged in, calibrate one, or see what it says.

    A wheel gives labels only after it was calibrated here: which axis steers, which way, and how
    far differ between models, drivers and systems.

    Example: steerlab wheel calibrate
    """
    from steerlab.app import wheel_commands
    from steerlab.teleop.sdl import SdlEvents

    with SdlEvents(window=act == "calibrate" or (act == "test" and not text)) as events:
        if act == "list":
            from steerlab.teleop.devices.profile_folder import sound_profiles

            wheels = wheel_commands.find_wheels(events)
            if json:
                print_json([plugged.to_dict() for plugged in wheels])
            else:
                print("\n".join(wheel_commands.list_lines(wheels)))
            _, damaged = sound_profiles()
            for error in damaged:
                print(f"steerlab: {error} Mend or remove the file.", file=sys.stderr)
            return 1 if damaged else 0
        if act == "calibrate":
            from steerlab.teleop.screen.drive_screen import DriveScreen

            with DriveScreen(events, screen_config(size)) as screen:
                kept = wheel_commands.calibrate_wheel(screen, events, name=name)
            print("Stopped; nothing was kept." if kept is None else f"Wrote {kept}")
            return 1 if kept is None else 0
        return _test(wheel_commands, events, name, text=text, size=size)


def _test(wheel_commands, events, name: str, *, text: bool, size: str) -> int:
    from steerlab.teleop.devices.wheel import WheelDevice

    device = WheelDevice(events, name=name)
    device.connect()
    try:
        if text:
            for line in wheel_commands.watch_lines(events, device):
                print(f"\r{line:<100}", end="", flush=True)
        else:
            from steerlab.teleop.screen.drive_screen import DriveScreen

            with DriveScreen(events, screen_config(size)) as screen:
                wheel_commands.watch_on_screen(screen, events, device)
    finally:
        device.disconnect()
    return 0
