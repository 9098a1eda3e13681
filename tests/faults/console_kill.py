"""The console killed while answers arrive, and while a drive that it started goes on."""

import random
import subprocess
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from threading import Timer
from time import perf_counter, sleep

import httpx

from steerlab.sim.files.folder_lock import RUN_LOCK, locked
from steerlab.study.contract import PhaseKind, Role
from steerlab.study.study import Study
from tests.faults.console import Console, Desk, Tablet
from tests.study.conftest import make_small
from tests.teleop.display import Display

LONGEST_S = 120.0


@dataclass
class Kills:
    """What came of them.

    Attributes:
        midway: kills before the person was through with the pages, or the drive at its end.
        acknowledged: answers by then.
    """

    kills: int = 0
    midway: int = 0
    acknowledged: int = 0
    broken: list[str] = field(default_factory=list)


def kill_while_answering(room: Path, kills: int, seed: int) -> Kills:
    """Kill a console so often at a random moment of a person's pages, each time another person's."""
    rng, report, took_s = random.Random(f"answers-{seed}"), Kills(), 0.5
    folder = make_small(room / "study")
    console = Console(folder)
    for _ in range(kills):
        who, token = _new_person(folder)
        tablet, after_s = Tablet(token, rng), rng.uniform(0.0, took_s)
        timer = Timer(after_s, console.process.kill)
        timer.start()
        try:
            tablet.walk(console.address)
        except httpx.TransportError:
            report.midway += 1
        timer.join()
        console.kill()
        report.kills += 1
        report.acknowledged += len(tablet.kept)
        report.broken += _wrong(folder, who, tablet)
        console, began = Console(folder), perf_counter()
        tablet.walk(console.address)
        took_s = after_s + perf_counter() - began
        report.broken += [*_wrong(folder, who, tablet), *_not_at(folder, who, PhaseKind.PRACTICE)]
    report.broken += console.stop()
    return report


def kill_while_driving(room: Path, kills: int, seed: int) -> Kills:
    """Kill a console so often after it started a scripted drive, which ends by itself and counts."""
    rng, report, took_s = random.Random(f"drives-{seed}"), Kills(), 2.0
    folder = make_small(room / "driven")
    for _ in range(kills):
        who, token = _new_person(folder)
        with Console(folder, "scripted:human:5") as console:
            tablet, desk = Tablet(token, rng), Desk(console)
            tablet.walk(console.address)
            desk.act(who, "start")
            (wheel,) = _children(console.process.pid)
            sleep(rng.uniform(0.0, took_s))
            report.midway += not _has_ended(wheel)
            console.kill()
            report.kills += 1
            began = perf_counter()
            report.broken += _ends(wheel, folder, who)
            took_s = max(took_s, perf_counter() - began)
            desk.close()
        report.broken += [
            *_wrong(folder, who, tablet),
            *_not_at(folder, who, PhaseKind.INSTRUCTIONS),
        ]
    return report


def kill_before_a_window(room: Path) -> list[str]:
    """Kill a console while somebody sits before a window that it opened: they can go on, and end it.

    Returns:
        what is wrong.
    """
    folder = make_small(room / "window")
    with closing(Display(room)) as display:
        return _kill_before(display, folder)


def _kill_before(display: Display, folder: Path) -> list[str]:
    who, token = _new_person(folder)
    with Console(folder, "mouse", display.environment) as console:
        Tablet(token, random.Random(0)).walk(console.address)
        desk = Desk(console)
        desk.act(who, "start")
        (wheel,) = _children(console.process.pid)
        while not _has_window(display):
            sleep(0.1)
        console.kill()
        desk.close()
    problems = ["the window was closed"] if _has_ended(wheel) else []
    with Console(folder, "mouse", display.environment) as console:
        desk, began = Desk(console), perf_counter()
        desk.act(who, "start")
        while f"process {wheel}" not in desk.page(f"/participants/{who}"):
            if perf_counter() - began > LONGEST_S:
                problems.append("the next console does not say who sits at the wheel")
                break
            sleep(0.2)
        problems += ["the window was closed"] if _has_ended(wheel) else []
        display.close()
        desk.close()
        problems += [*_ends(wheel, folder, who), *console.stop()]
    return [*problems, *_not_at(folder, who, PhaseKind.PRACTICE)]


def _has_window(display: Display) -> bool:
    found = subprocess.run(
        ["xdotool", "search", "--class", "."],
        env=display.environment,
        capture_output=True,
        check=False,
    )
    return found.stdout != b""


def _new_person(folder: Path) -> tuple[str, str]:
    with Study.open(folder) as study:
        who = study.enrol(Role.TRAINING).id
        return who, study.new_link(who)


def _wrong(folder: Path, who: str, tablet: Tablet) -> list[str]:
    with Study.open(folder, read_only=True) as study:
        bad = [f"{one.what}: {one.found}" for one in study.verify().findings if not one.ok]
        return [*tablet.wrong(study, who), *bad]


def _not_at(folder: Path, who: str, kind: PhaseKind) -> list[str]:
    with Study.open(folder, read_only=True) as study:
        phase = study.participant(who).next_phase
    return [] if phase is not None and phase.kind is kind else [f"{who} is at {phase}"]


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def _has_ended(pid: int) -> bool:
    """Also if nobody has asked how."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def _ends(wheel: int, folder: Path, who: str) -> list[str]:
    """The process at the wheel goes on without its console, ends, and lets the study go."""
    began = perf_counter()
    while not _has_ended(wheel):
        if perf_counter() - began > LONGEST_S:
            return [f"the drive of {who} still runs {LONGEST_S:.0f} s after its console's end"]
        sleep(0.05)
    with locked(folder, RUN_LOCK, "looks at"):
        return []
