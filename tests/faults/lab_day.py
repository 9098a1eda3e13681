"""A day in the laboratory, fast: one console and one study, people in turn, and what a day brings."""

import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, sleep

import httpx

from steerlab.study.contract import ParticipantView, Standing
from steerlab.study.derived import left_of
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from tests.faults.console import Console, Desk, Tablet
from tests.faults.soak import Resources
from tests.study.conftest import make_small

FIRST = 5  # people after whom the console is taken to have all it needs
MORE_THREADS, MORE_HANDLES, MORE_MB = 0, 2, 30.0
AN_HOUR = 8  # people
DRIVE_S = 120.0


@dataclass
class Day:
    """What came of it.

    Attributes:
        seen: what the console's process held after each person.
    """

    people: int = 0
    answers: int = 0
    drives: int = 0
    analyses: int = 0
    erased: int = 0
    seen: list[Resources] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)


def lab_day(room: Path, people: int, seed: int) -> Day:
    """So many people come, one after another; the console must hold no more after the last.

    Every third one's drives are started from the console; once an hour the experimenter looks at the
    checks, analyses, makes a backup, and erases somebody.
    """
    rng, day, folder = random.Random(f"day-{seed}"), Day(), make_small(room / "study")
    with Console(folder, "scripted:human:7") as console:
        desk = Desk(console)
        for number in range(people):
            _one_person(day, folder, console, desk, rng, by_console=number % 3 == 0)
            if number % AN_HOUR == AN_HOUR // 2:
                _once_an_hour(day, folder, desk, rng, room / "copy")
            day.people += 1
            day.seen.append(Resources.now(str(console.process.pid)))
        desk.close()
        day.broken += console.stop()
    day.broken += [*_verified(folder), *_grown(day.seen)]
    return day


def _one_person(
    day: Day, folder: Path, console: Console, desk: Desk, rng: random.Random, *, by_console: bool
) -> None:
    who = desk.enrol()
    token = desk.token(who)
    tablet = Tablet(token, rng)
    with _following(console.address, f"/p/{token}/events"):
        for _ in ("practice", "calibration"):
            tablet.walk(console.address)
            if by_console:
                before = _phase(folder, who)
                desk.act(who, "start")
                day.broken += _wait(folder, who, lambda view, at=before: _at(view) != at)
            else:
                _drive(folder, who, rng.randrange(1000))
            day.drives += 1
        tablet.walk(console.address)
    day.answers += len(tablet.kept)
    with Study.open(folder, read_only=True) as study:
        day.broken += tablet.wrong(study, who)
        standing = study.participant(who).standing
        day.broken += [] if standing is Standing.FINISHED else [f"{who} is {standing} in the end"]


def _once_an_hour(day: Day, folder: Path, desk: Desk, rng: random.Random, copy: Path) -> None:
    desk.page("/checks")
    day.broken += _steerlab("analyze", folder, "--seeds", "0", "--permutations", "99")
    day.analyses += 1
    day.broken += _steerlab("study", "backup", folder, copy)
    with Study.open(folder, read_only=True) as study:
        there = [one.id for one in study.participants() if not one.standing.withdrawn]
    leaves = rng.choice(there)
    desk.act(leaves, "withdraw", outcome="erase", typed=leaves)
    day.broken += _wait(folder, leaves, lambda view: view.standing is Standing.WITHDRAWN_ERASED)
    day.broken += [f"{path} still holds {leaves}" for path in left_of(folder, leaves)]
    day.erased += 1


def _steerlab(*arguments: str | Path) -> list[str]:
    command = [sys.executable, "-m", "steerlab.app.cli", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return [f"{arguments}: {done.stderr}"] if done.returncode or done.stderr else []


def _drive(folder: Path, who: str, seed: int) -> None:
    device = ScriptedParticipant(kind="human", seed=seed).device
    with Study.open(folder) as study:
        study.run(who, RunConfig(device=device, recordings=False))


@contextmanager
def _following(address: str, *streams: str) -> Iterator[None]:
    """Pages that are open and follow the study."""
    with ExitStack() as stack:
        client = stack.enter_context(httpx.Client(base_url=address, timeout=60))
        for path in streams:
            answer = stack.enter_context(client.stream("GET", path))
            next(answer.iter_lines())
        yield


def _at(view: ParticipantView) -> str | None:
    return None if view.next_phase is None else view.next_phase.id


def _phase(folder: Path, who: str) -> str | None:
    with Study.open(folder, read_only=True) as study:
        return _at(study.participant(who))


def _wait(folder: Path, who: str, until: Callable[[ParticipantView], bool]) -> list[str]:
    began = perf_counter()
    with Study.open(folder, read_only=True) as study:
        while not until(view := study.participant(who)):
            if perf_counter() - began > DRIVE_S:
                return [f"{who} is {view.standing} at {_at(view)} after {DRIVE_S:.0f} s"]
            sleep(0.1)
    return []


def _verified(folder: Path) -> list[str]:
    with Study.open(folder, read_only=True) as study:
        return [f"{one.what}: {one.found}" for one in study.verify().findings if not one.ok]


def _grown(seen: list[Resources]) -> list[str]:
    """What the console held more of after the last person than after the first few."""
    if len(seen) <= FIRST:
        return []
    first, last = seen[FIRST - 1], seen[-1]
    grown = {
        "threads": last.threads - first.threads - MORE_THREADS,
        "handles": last.handles - first.handles - MORE_HANDLES,
        "MB": last.memory_mb - first.memory_mb - MORE_MB,
    }
    return [
        f"the console grew by {more:.0f} {what} too many"
        for what, more in grown.items()
        if more > 0
    ]
