"""How long a user waits for a command. ``python -m benchmarks.commands``."""

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.rows import Row, at_most, print_rows


def run() -> list[Row]:
    """One row a figure."""
    command = [sys.executable, "-m", "steerlab.app.cli"]
    help_s = median(_seconds([*command, "--help"]) for _ in range(5))
    with tempfile.TemporaryDirectory() as folder:
        demo_s = _seconds([*command, "demo", "--out", str(Path(folder) / "demo")])
    return [
        at_most("steerlab --help", help_s, 0.5, "s"),
        at_most("steerlab demo", demo_s, 60.0, "s"),
    ]


def _seconds(command: list[str]) -> float:
    started = perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return perf_counter() - started


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
