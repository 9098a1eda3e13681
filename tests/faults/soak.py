"""What survives a long day: ``python -m tests.faults.soak --kills 200 --cases 1000000``, or ``make soak``.

Kills every writing verb at random moments, gives it too little disk or handles, damages every file
that steerlab reads, lets pairs of commands meet, kills the console, and has people come for a day;
prints what it did and what broke, and ends with 1 if anything did.
"""

import argparse
import logging
import os
import resource
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from steerlab.sim.rollout import Rollout
from steerlab.teleop.devices.contract import DeviceInfo, DeviceSample, InputKind


@dataclass(frozen=True, kw_only=True)
class Resources:
    """What a process holds, as Linux counts it."""

    threads: int
    handles: int
    memory_mb: float

    @classmethod
    def now(cls, process: str = "self") -> "Resources":
        """Of this process, or of the one of that id."""
        pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
        return cls(
            threads=len(os.listdir(f"/proc/{process}/task")),
            handles=len(os.listdir(f"/proc/{process}/fd")),
            memory_mb=pages * resource.getpagesize() / 1e6,
        )


class SteadyWheel:
    """A device that holds one position."""

    info = DeviceInfo(kind=InputKind.SCRIPTED, name="steady")

    def connect(self) -> None:
        """Nothing to open."""

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Nothing to get ready."""

    def read(self, step: int | None = None) -> DeviceSample:
        """A little to the left."""
        return DeviceSample(wheel=0.25)

    def disconnect(self) -> None:
        """Nothing to close."""


def main() -> int:
    """Run what was asked for."""
    from tests.faults.kills import VERBS, kill_often
    from tests.faults.readers import READERS
    from tests.faults.test_readers import fuzz

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--scarcities", type=int, default=100, help="too little disk and the like")
    parser.add_argument("--cases", type=int, default=1_000_000)
    parser.add_argument("--pairs", type=int, default=10, help="meetings of each pair of commands")
    parser.add_argument("--console-kills", type=int, default=50)
    parser.add_argument("--day", type=int, default=60, help="people who come on one day")
    parser.add_argument("--seed", type=int, default=0)
    wanted = parser.parse_args()
    logging.disable(logging.CRITICAL)
    broken: list[str] = []
    with tempfile.TemporaryDirectory() as room:
        each = -(-wanted.kills // len(VERBS))
        for verb in VERBS if wanted.kills else ():
            began, report = (
                perf_counter(),
                kill_often(verb, Path(room) / verb.name, each, wanted.seed),
            )
            broken += report.broken
            print(f"{verb.name}: {report.kills} kills, {len(report.broken)} broke something, "
                  f"{perf_counter() - began:.0f} s", flush=True)  # fmt: skip
        broken += _starve(Path(room) / "scarce", wanted.scarcities, wanted.seed)
        shares = sum(reader.share for reader in READERS)
        for reader in READERS if wanted.cases else ():
            began, cases = perf_counter(), round(wanted.cases * reader.share / shares)
            first = wanted.seed * 100_000_000
            made = reader.write(Path(tempfile.mkdtemp(dir=room)))
            leaks = fuzz(reader, made, Path(room) / "copy", range(first, first + cases))
            broken += leaks
            print(f"{reader.name}: {cases} cases, {len(leaks)} leaks, "
                  f"{perf_counter() - began:.0f} s", flush=True)  # fmt: skip
        broken += _meet(Path(room) / "pairs", wanted.pairs, wanted.seed)
        broken += _kill_consoles(Path(room) / "console", wanted.console_kills, wanted.seed)
        broken += _have_a_day(Path(room) / "day", wanted.day, wanted.seed)
    print("\n".join(broken) or "Nothing broke.")
    return 1 if broken else 0


def _starve(room: Path, trials: int, seed: int) -> list[str]:
    from tests.faults.kills import VERBS
    from tests.faults.scarcity import no_small_disk, starve

    if trials and (why := no_small_disk()):
        print(why)
    broken: list[str] = []
    for verb in VERBS if trials else ():
        began, met = perf_counter(), starve(verb, room / verb.name, -(-trials // len(VERBS)), seed)
        broken += met.broken
        tried = ", ".join(f"{times} of {kind.value}" for kind, times in met.tried.items())
        print(f"{verb.name}: {tried}; {met.refused} refusals, {len(met.broken)} broke something, "
              f"{perf_counter() - began:.0f} s", flush=True)  # fmt: skip
    return broken


def _meet(room: Path, times: int, seed: int) -> list[str]:
    from tests.faults.pairs import LONG_PAIRS, PAIRS, meet_often

    broken: list[str] = []
    for pair in (*PAIRS, *LONG_PAIRS) if times else ():
        began, met = perf_counter(), meet_often(pair, room, times, seed)
        broken += met.broken
        print(f"{pair.name}: {times} meetings, {met.refused} refusals, {len(met.broken)} broke "
              f"something, {perf_counter() - began:.0f} s", flush=True)  # fmt: skip
    return broken


def _kill_consoles(room: Path, kills: int, seed: int) -> list[str]:
    from tests.faults.console_kill import (
        kill_before_a_window,
        kill_while_answering,
        kill_while_driving,
    )

    if not kills:
        return []
    room.mkdir()
    broken: list[str] = []
    if shutil.which("Xvfb") and shutil.which("xdotool"):
        broken += kill_before_a_window(room)
        print(f"a window outlives its console: {len(broken)} broke something", flush=True)
    else:
        print("a window outlives its console: not tried without Xvfb and xdotool", flush=True)
    for act, times in ((kill_while_answering, kills), (kill_while_driving, -(-kills // 3))):
        report = act(room, times, seed)
        broken += report.broken
        print(f"{act.__name__}: {report.kills} kills, {report.midway} midway, {report.acknowledged} "
              f"answers acknowledged, {len(report.broken)} broke something", flush=True)  # fmt: skip
    return broken


def _have_a_day(room: Path, people: int, seed: int) -> list[str]:
    from tests.faults.lab_day import lab_day

    if not people:
        return []
    room.mkdir()
    day = lab_day(room, people, seed)
    print(f"a day: {day.people} people, {day.answers} answers, {day.drives} drives, {day.analyses} "
          f"analyses and backups, {day.erased} erasures, {len(day.broken)} broke something; the "
          f"console began with {day.seen[0]} and ended with {day.seen[-1]}", flush=True)  # fmt: skip
    return day.broken


if __name__ == "__main__":
    sys.exit(main())
