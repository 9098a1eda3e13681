"""How long a user waits for a command. ``python -m benchmarks.commands``."""

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

Row = dict[str, Any]


def run() -> list[Row]:
    """One row a figure."""
    command = [sys.executable, "-m", "steerlab.teleop.cli"]
    help_s = median(_seconds([*command, "--help"]) for _ in range(5))
    with tempfile.TemporaryDirectory() as folder:
        demo_s = _seconds([*command, "demo", "--out", str(Path(folder) / "demo")])
    return [
        {"name": name, "measured": seconds, "limit": limit, "unit": "s", "ok": seconds <= limit}
        for name, seconds, limit in (
            ("steerlab --help", help_s, 0.5),
            ("steerlab demo", demo_s, 60.0),
        )
    ]


def _seconds(command: list[str]) -> float:
    started = perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return perf_counter() - started


if __name__ == "__main__":
    for row in run():
        print(row)
