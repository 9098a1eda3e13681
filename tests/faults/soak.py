"""What survives a long day: ``python -m tests.faults.soak --kills 200 --cases 1000000``, or ``make soak``.

Kills every writing verb at random moments, and damages every file that steerlab reads; prints what
it did and what broke, and ends with 1 if anything did.
"""

import argparse
import logging
import os
import resource
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
    def now(cls) -> "Resources":
        """Of this process."""
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return cls(
            threads=len(os.listdir("/proc/self/task")),
            handles=len(os.listdir("/proc/self/fd")),
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
    parser.add_argument("--cases", type=int, default=1_000_000)
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
        shares = sum(reader.share for reader in READERS)
        for reader in READERS if wanted.cases else ():
            began, cases = perf_counter(), round(wanted.cases * reader.share / shares)
            first = wanted.seed * 100_000_000
            made = reader.write(Path(tempfile.mkdtemp(dir=room)))
            leaks = fuzz(reader, made, Path(room) / "copy", range(first, first + cases))
            broken += leaks
            print(f"{reader.name}: {cases} cases, {len(leaks)} leaks, "
                  f"{perf_counter() - began:.0f} s", flush=True)  # fmt: skip
    print("\n".join(broken) or "Nothing broke.")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
