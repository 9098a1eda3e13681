"""``steerlab study run`` with somebody who teaches at a virtual wheel: a program, for tests and pictures.

``python virtual_teacher.py FOLDER PLAN -- ARGUMENTS``: as ``virtual_person.py``, but they know the
way: they steer as the oracle would, and hold the take-over button from the first to the last second
in ``PLAN["hold"]``, in rounds only; they stop at a page whose title has ``PLAN["leave"]`` in it.
``PLAN["short"]`` teaches in a world of a few metres. At the end it prints what was measured, as JSON.
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from threading import Thread
from time import sleep

import numpy as np
from before_screen import sit_before  # pyright: ignore[reportMissingImports]
from virtual_person import NAME, Person  # pyright: ignore[reportMissingImports]

from steerlab.app import loop_check
from steerlab.app.cli import main
from steerlab.learning.agents.drive import Robot
from steerlab.sim.errors import NoPath
from steerlab.sim.ground_truth import Planner
from steerlab.sim.tasks import Task, make_task
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.study.teaching import run_teaching
from steerlab.study.teaching.human_interface import HumanInterface
from steerlab.teleop import seat
from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.sdl import pygame

TAKE_OVER = 4  # the button's number


def short_task(name: str, *, noise: float) -> Task:
    """The world of a few metres that tests of teaching have; a program finds them by itself."""
    sys.path.append(str(Path(__file__).parents[1] / "study" / "teaching"))
    import conftest  # pyright: ignore[reportMissingImports]

    return conftest.short_task(name, noise=noise)


class TeachingPerson(Person):
    """Knows the way."""

    def __init__(self, plan: dict) -> None:
        super().__init__(plan)
        self.wanted = 0.0
        self.frame, self.elapsed_s = 0, 0.0
        task = (short_task if plan.get("short") else make_task)(plan.get("task", "easy"), noise=0.0)
        self.planner = Planner(task.world, seed=0, car=task.car, config=task.planning)

    def sit_down(self) -> None:
        self.wheel.plug_in()
        Thread(target=self.steer, daemon=True).start()

    def steer(self) -> None:
        flicker = 0
        while True:
            sleep(0.004)
            flicker ^= 1  # a wheel that says nothing is not heard
            axis = self.wanted / WHEEL_LIMIT if self.driving else 0.0
            try:
                self.wheel.axis(0, float(np.clip(axis + 0.002 * flicker, -1.0, 1.0)))
                first, last = self.plan.get("hold", (0, 0))
                held = self.driving and self.watching and first <= self.elapsed_s < last
                held = held or self.trying
                self.wheel.button(TAKE_OVER, held)
            except DeviceError:  # the session is over
                continue

    watching = trying = False

    def look_at_page(self, screen, page) -> None:
        self.driving, self.frame = False, 0
        self.trying = "take-over button" in page.title
        what = " | ".join((page.title, page.big, *page.lines))
        learning = any(name == "Learning" and value is not None and value < 1.0
                       for name, value in page.bars)  # fmt: skip
        if self.seen[-1:] != [what]:
            self.seen.append(what)
            print(what, flush=True)
        if learning and dict(page.bars)["Learning"] > 0.25:
            self.shoot(screen, "learning")
        for name in ("Teaching robot", "is done", "Not yet"):
            if name in page.title and "Space" in dict(page.keys):
                if name == "is done" and page.lines[1:]:
                    name = "learnt"
                self.shoot(screen, name if "Now the robot" not in page.lines[0] else "before")
        if self.plan.get("leave", "nowhere") in page.title:
            self.press(pygame.K_ESCAPE)
        elif "Space" in dict(page.keys):
            self.press(pygame.K_SPACE)

    def look_at_drive(self, screen, view) -> None:
        self.trying = False
        self.driving = view.elapsed_s > 0.0
        self.watching = view.number > 1
        self.frame, self.elapsed_s = self.frame + 1, view.elapsed_s
        try:
            self.wanted = self.planner.label(view.pose, 5.0)
        except NoPath:
            self.wanted = 0.0
        kind = "drive" if not self.watching else "taken over" if view.teacher_drives else "round"
        if self.frame >= 60:
            self.shoot(screen, kind)


def run(folder: Path, plan: dict, arguments: list[str]) -> int:
    os.environ["XDG_CONFIG_HOME"] = str(folder / "config")
    person = TeachingPerson(plan)
    profile = loop_check.virtual_profile(person.wheel).profile
    save_profile(replace(profile, name=NAME, buttons={Button.TAKE_OVER: TAKE_OVER}))

    sit_before(person, seat)
    if plan.get("short"):
        run_teaching.make_task = short_task
    interfaces, robots = _kept(HumanInterface), _kept(Robot)
    code = main(arguments)
    decided = [ns for robot in robots for ns in robot.decision_ns] or [0]
    measured = {
        "decision_ms": [float(np.percentile(decided, p)) / 1e6 for p in (50, 99, 100)],
        "rest_s": [ns / 1e9 for one in interfaces for ns in one.rests_ns],
        "lateness_p99_ms": [health.lateness_p99_ms for one in interfaces for health in one.health],
        "frame_p99_ms": [health.frame_p99_ms for one in interfaces for health in one.health],
        "dropped": [health.dropped / max(1, health.frames + health.dropped)
                    for one in interfaces for health in one.health],
    }  # fmt: skip
    print("measured", json.dumps(measured), flush=True)
    return code


def _kept(kind: type) -> list:
    """All of that kind that will be made."""
    made, init = [], kind.__init__

    def remember(self, *arguments, **named):
        made.append(self)
        init(self, *arguments, **named)

    kind.__init__ = remember
    return made


if __name__ == "__main__":
    cut = sys.argv.index("--")
    sys.exit(run(Path(sys.argv[1]), json.loads(sys.argv[2]), sys.argv[cut + 1 :]))
