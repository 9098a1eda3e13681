"""``steerlab wheel calibrate`` and ``drive`` with somebody at a virtual wheel that nobody knows yet.

``python virtual_driver.py FOLDER SHOTS -- ARGUMENTS``: the person does what the pages say and
drives straight at the ball. SHOTS (JSON) names pictures to take, such as ``{"check": "x.png"}``.
The wheel's left end is at -0.9 of its axis and its pedals are inverted, as on many wheels.
"""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from before_screen import sit_before  # pyright: ignore[reportMissingImports]

from steerlab.app.cli import main
from steerlab.sim.geometry import bearing_rad
from steerlab.teleop import sdl, seat
from steerlab.teleop.devices.virtual import VirtualJoystick
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import pygame

LEFT, RIGHT = -0.9, 0.9  # of the axis
THROTTLE, BRAKE = 2, 1
PRESSED, RELEASED = -1.0, 1.0
BUTTONS = {"pause a drive": 9, "redo a drive": 8, "take over": 4}
STEPS_S = 0.15  # between two things a person does


class Driver:
    """Reads a page, and does one thing after another about it."""

    def __init__(self, shots: dict[str, str]) -> None:
        self.wheel = VirtualJoystick(name="Somebody's wheel")
        self.shots = shots
        self.read = ""
        self.left: list[Callable[[], None]] = []
        self.next_s = 0.0
        self.ball_xy_m = (0.0, 0.0)

    def look_at_page(self, screen: DriveScreen, page) -> None:
        text = " | ".join([page.title, page.big, *page.lines[:1]])
        if text != self.read:
            self.read = text
            print(text, flush=True)
            self.left = self.acts(page.title, " ".join(page.lines))
            self.next_s = perf_counter() + STEPS_S
        if perf_counter() >= self.next_s and self.left:
            self.left.pop(0)()
            self.next_s = perf_counter() + STEPS_S
            for name in [name for name in self.shots if name in page.title]:
                screen.save(self.shots.pop(name))

    def acts(self, title: str, text: str) -> list[Callable[[], None]]:
        if "Measuring" in text:
            return []
        if "each pedal once" in title:
            return [self.axis(axis, at) for axis in (THROTTLE, BRAKE) for at in (PRESSED, RELEASED)]
        for words, button in BUTTONS.items():
            if words in text:
                return [self.button(button, True), self.button(button, False)]
        for pedal, axis in (("throttle", THROTTLE), ("brake", BRAKE)):
            if f"The {pedal}. Press" in text:
                return [self.axis(axis, PRESSED), self.space]
            if f"The {pedal}. Release" in text:
                return [self.axis(axis, RELEASED), self.space]
        ways = {"hands off the wheel": (), "to the left": (LEFT / 2, LEFT),
                "to the right": (RIGHT / 2, RIGHT), "return to the centre": (0.1, 0.0)}  # fmt: skip
        if "needle must reach" in text:
            return [*(self.axis(0, at) for at in (LEFT, RIGHT, 0.0)), self.space]
        for words, places in ways.items():
            if words in text:
                return [*(self.axis(0, place) for place in places), self.space]
        if any(words in text for words in ("Move it", "Centre", "centred")):
            return [self.axis(0, 0.01), self.axis(0, 0.0)]
        return [self.space]

    def sit_down(self) -> None:
        self.wheel.plug_in()

    def look_at_world(self, world) -> None:
        self.ball_xy_m = world.ball_xy_m

    def look_at_drive(self, screen: DriveScreen, view) -> None:
        self.read = ""
        if view.elapsed_s < 0.04:
            return  # the still picture behind the countdown
        wheel = min(1.0, max(-1.0, 1.6 * bearing_rad(view.pose, self.ball_xy_m)))
        self.wheel.axis(0, wheel * LEFT)
        self.wheel.axis(THROTTLE, -0.2)  # 0.6 of the way
        self.wheel.axis(BRAKE, RELEASED)
        if view.elapsed_s > 2.0 and "drive" in self.shots:
            screen.save(self.shots.pop("drive"))

    def axis(self, axis: int, value: float) -> Callable[[], None]:
        return lambda: self.wheel.axis(axis, value)

    def button(self, button: int, down: bool) -> Callable[[], None]:
        return lambda: self.wheel.button(button, down)

    def space(self) -> None:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_SPACE, mod=0, unicode=""))


def run(folder: Path, shots: dict[str, str], arguments: list[str]) -> int:
    os.environ["XDG_CONFIG_HOME"] = str(folder / "config")
    driver = Driver(shots)

    sit_before(driver, sdl, seat)
    return main(arguments)


if __name__ == "__main__":
    cut = sys.argv.index("--")
    sys.exit(run(Path(sys.argv[1]), json.loads(sys.argv[2]), sys.argv[cut + 1 :]))
