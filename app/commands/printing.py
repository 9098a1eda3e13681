"""What commands print: results, where they are, and progress."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from steerlab.sim.progress import Progress

if TYPE_CHECKING:
    from steerlab.analysis.summary import Summary
    from steerlab.study.contract import StudyCheck


def command_line(verb: str, settings: Mapping[str, object], out: Path, *arguments: str) -> str:
    """The command line that gives the same results, with every setting spelt out.

    Args:
        settings: by name; of several words, a tuple.
        arguments: those without a name.
    """
    options: list[str] = []
    for name, value in settings.items():
        words = value if isinstance(value, tuple) else (value,)
        options += [f"--{name.replace('_', '-')}", *(quoted(word) for word in words)]
    return " ".join(
        ["steerlab", verb, *map(quoted, arguments), *options, "--out", quoted(out.name)]
    )


def quoted(word: object) -> str:
    """A word of a command line to copy, as text: what is none in a name of a file becomes a mark."""
    return quote(str(word).encode("utf-8", "surrogateescape").decode("utf-8", "replace"))


def print_summary(summary: "Summary", out: Path, *, as_json: bool) -> int:
    """Print a summary's headline and where the rest is, or all of it as JSON."""
    if as_json:
        print_json(summary.to_dict())
        return 0
    from steerlab.analysis.wording import headline

    print(headline(summary))
    print_where(out)
    return 0


def print_where(out: Path) -> None:
    """Print where report and numbers are."""
    print(f"Report: {out / 'report' / 'index.html'}")
    print(f"Numbers: {out / 'summary.json'}")


def print_check(check: "StudyCheck") -> None:
    """Print what a check of a study found, and the mend."""
    verdict = "BAD " if not check.ok else "note" if check.notice else "ok  "
    print(f"{verdict} {check.what}: {check.found}")
    if check.mend:
        print(f"       mend: {check.mend}")


@contextmanager
def progress_bar(*, time_left: bool = False) -> Iterator[Progress]:
    """A progress bar on stderr for people; nothing where stderr is no terminal.

    Args:
        time_left: also say how long it will take, for what takes minutes to hours.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns: list[ProgressColumn] = [
        TextColumn("{task.description:<28}"),
        BarColumn(),
        TimeElapsedColumn(),
    ]
    if time_left:
        columns += [TextColumn("left"), TimeRemainingColumn(elapsed_when_finished=False)]
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        tasks: dict[str, Any] = {}

        def show(what: str, share: float) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=1.0)
            bar.update(tasks[what], completed=share)

        yield show


def print_json(values: object) -> None:
    """Print plain values as JSON."""
    print(json.dumps(values, indent=2, ensure_ascii=False))
