"""``steerlab`` with somebody at a virtual wheel: run as a program, for tests and pictures.

``python virtual_person.py FOLDER PLAN -- ARGUMENTS``: ARGUMENTS go to ``steerlab``; the person
centres the wheel in countdowns, steers to and fro in drives and at the ball in practice, goes on
where one may, and does what PLAN says (JSON): ``{"pause": 40, "unplug": 80, "stop": 90, "shots":
{"countdown": "x.png"}}``, where numbers count display frames of drives.
"""

import json
import os
import sys
from dataclasses import replace
from math import sin
from pathlib import Path
from threading import Thread
from time import perf_counter, sleep

from before_screen import sit_before  # pyright: ignore[reportMissingImports]

from steerlab.app import loop_check
from steerlab.app.cli import main
from steerlab.sim.geometry import bearing_rad
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop import seat
from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.devices.virtual import VirtualJoystick
from steerlab.teleop.screen.drive_screen import DriveScreen
from steerlab.teleop.sdl import pygame

NAME = "Logitech G920"


class Person:
    """Sees what the screen shows and moves the wheel."""

    def __init__(self, plan: dict) -> None:
        self.plan = plan
        self.wheel = VirtualJoystick(name=NAME)
        self.driving = False
        self.aim: float | None = None  # where the wheel should be to drive at the ball
        self.frames = 0
        self.unplugged_at: float | None = None
        self.seen: list[str] = []

    def sit_down(self) -> None:
        self.wheel.plug_in()
        Thread(target=self.steer, daemon=True).start()

    def steer(self) -> None:
        began = perf_counter()
        while True:
            sleep(0.004)
            t = perf_counter() - began
            if self.unplugged_at is not None:
                if perf_counter() - self.unplugged_at > 1.0:
                    self.unplugged_at = None
                    self.wheel.plug_in()
                continue
            reach = 0.6 if self.driving else 0.02
            aim = self.aim if self.driving else None
            try:
                self.wheel.axis(0, reach * sin(2.0 * t) if aim is None else aim)
            except DeviceError:  # unplugged just now, or the session is over
                continue

    def press(self, key: int) -> None:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0, unicode=""))

    def look_at_page(self, screen: DriveScreen, page) -> None:
        self.driving = False
        what = f"{page.title} | {page.big}"
        if not self.seen or self.seen[-1] != what:
            self.seen.append(what)
            print(what, *page.lines, sep=" | ", flush=True)
        for name in ("Pause", "is done", "Thank you"):
            if name in page.title:
                self.shoot(screen, name)
        if page.big == "2":
            self.shoot(screen, "countdown")
        if "Space" in dict(page.keys):
            self.press(pygame.K_SPACE)

    def look_at_drive(self, screen: DriveScreen, view) -> None:
        self.driving = view.elapsed_s > 0.0
        self.aim = None
        if view.balls is not None:
            wheel = 4.0 * bearing_rad(view.pose, screen._world.ball_xy_m)
            self.aim = max(-1.0, min(1.0, wheel / WHEEL_LIMIT))
        self.frames += 1
        if self.frames == 90:
            self.shoot(screen, "drive")
            print("90 frames", flush=True)
        if self.frames == self.plan.get("pause"):
            self.press(pygame.K_p)
        if self.frames == self.plan.get("stop"):
            self.press(pygame.K_ESCAPE)
            self.press(pygame.K_ESCAPE)  # it asks once
        if self.frames == self.plan.get("unplug"):
            self.wheel.unplug()
            self.unplugged_at = perf_counter()

    def shoot(self, screen: DriveScreen, name: str) -> None:
        path = self.plan.get("shots", {}).pop(name, None)
        if path is not None:
            screen.save(path)


def run(folder: Path, plan: dict, arguments: list[str]) -> int:
    os.environ["XDG_CONFIG_HOME"] = str(folder / "config")
    person = Person(plan)
    profile = loop_check.virtual_profile(person.wheel).profile
    save_profile(replace(profile, name=NAME))

    sit_before(person, seat)
    return main(arguments)


if __name__ == "__main__":
    cut = sys.argv.index("--")
    sys.exit(run(Path(sys.argv[1]), json.loads(sys.argv[2]), sys.argv[cut + 1 :]))
