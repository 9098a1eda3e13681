"""How long one waits before anything happens. ``python -m benchmarks.startup``.

Each figure is a ratio of two fresh processes that ran one after the other, the median of many such
pairs; both read from a warm cache. What is imported besides is in ``tests/test_startup.py``.
"""

import subprocess
import sys
from math import inf
from statistics import median
from time import perf_counter

from benchmarks.rows import Row, at_most, print_rows

PAIRS = 9
_TORCH = ["-c", "import torch"]
_TYRO = ["-c", "import tyro"]  # an empty interpreter with tyro
_MUJOCO = ["-c", "import mujoco"]
# MIND MELD, every other baseline of the ladder, and what reads a trained one.
_MAPPER = ["-c", "import steerlab.learning.baselines, steerlab.learning.checkpoint"]
_ENGINE = ["-c", "import steerlab.sim.engine.driving"]
_STEERLAB = ["-m", "steerlab.app.cli"]


def run() -> list[Row]:
    """One row a figure; the engine's has no limit."""
    help_of_all = _ratio([*_STEERLAB, "--help"], _TYRO)
    help_of_study = _ratio([*_STEERLAB, "study", "run", "--help"], _TYRO)  # the largest parser
    return [
        at_most("import of every mapper / of torch", _ratio(_MAPPER, _TORCH), 1.3, "times"),
        at_most("steerlab --help / import of tyro", help_of_all, 1.5, "times"),
        at_most("steerlab study run --help / tyro", help_of_study, 1.5, "times"),
        at_most("import of the engine / of mujoco", _ratio(_ENGINE, _MUJOCO), inf, "times"),
    ]


def _ratio(ours: list[str], theirs: list[str]) -> float:
    for both in (ours, theirs):
        _seconds(both)  # to warm the cache
    return median(_seconds(ours) / _seconds(theirs) for _ in range(PAIRS))


def _seconds(arguments: list[str]) -> float:
    started = perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return perf_counter() - started


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
