"""Every benchmark in one run: ``make bench`` or ``python -m benchmarks.run [--quality] [NAME ...]``.

Prints a row a figure and exits with 1 if a limit is missed. ``--quality`` adds the ten studies
of 34 + 34 teachers whose improvement the README reports, a thousand null studies, and the export of a
whole scripted study; minutes each.
"""

import sys
from collections.abc import Callable

from rich.console import Console
from rich.table import Table

from benchmarks import (
    analysis,
    commands,
    console,
    expected_error,
    export,
    ground_truth,
    mapper_quality,
    mapper_speed,
    markers,
    policy_speed,
    pretrained,
    recording,
    simulation,
    startup,
    store,
    study,
    style,
    teach,
    teaching,
    teleop,
)
from benchmarks.rows import Row

BENCHMARKS: dict[str, Callable[[], list[Row]]] = {
    "simulation": simulation.run,
    "ground_truth": ground_truth.run,
    "mapper": mapper_speed.run,
    "policy": policy_speed.run,
    "pretrained": pretrained.run,
    "expected_error": expected_error.run,
    "store": store.run,
    "recording": recording.run,
    "markers": markers.run,
    "style": style.run,
    "analysis": analysis.run,
    "teleop": teleop.run,
    "teaching": teaching.run,
    "teach": teach.speed,
    "console": console.run,
    "study": study.run,
    "startup": startup.run,
    "commands": commands.run,
}


def main(arguments: list[str]) -> int:
    """Run the named benchmarks, or all of them."""
    chosen = [name for name in arguments if name != "--quality"] or list(BENCHMARKS)
    unknown = sorted(set(chosen) - set(BENCHMARKS))
    if unknown:
        print(f"No benchmark {', '.join(unknown)}; choose from {', '.join(BENCHMARKS)}.")
        return 2
    rows = [(name, row) for name in chosen for row in BENCHMARKS[name]()]
    if "--quality" in arguments:
        judged = (mapper_quality.quality, pretrained.quality, analysis.quality, export.run)
        rows += [("quality", row) for quality in judged for row in quality()]
    table = Table("benchmark", "figure", "measured", "limit", "unit", "")
    for name, row in rows:
        verdict = "[green]ok[/]" if row["ok"] else "[red]MISSED[/]"
        measured, limit = f"{row['measured']:.4g}", f"{row['limit']:.4g}"
        table.add_row(name, row["name"], measured, limit, row["unit"], verdict)
    Console(width=None if sys.stdout.isatty() else 130).print(table)
    return 0 if all(row["ok"] for _, row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
