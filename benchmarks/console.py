"""Pages of the console over a real study of fifty people. ``python -m benchmarks.console``."""

import asyncio
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter

import httpx

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.teleop.console.forms import csrf_token
from steerlab.teleop.console.rendering import STATIC_TYPES, static_files
from steerlab.teleop.study.contract import Role
from steerlab.teleop.study.new import new_study
from steerlab.teleop.study.study import Study

PEOPLE = 50
PHASE, PART, ITEMS = "about-you", 2, 20  # the Mini-IPIP of the shipped protocol
VISITS = 20
PAGE_MS = 100.0
PAGE_KB = 100.0


def run() -> list[Row]:
    """One row a figure."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study"
        new_study(study, "mind-meld")
        tokens = _enrol(study)
        with _console(study) as (address, sign_in):
            lost, answer_ms, rate = _load(address, study, tokens)
            pages = _pages(address, sign_in, next(iter(tokens.values())))
    static_kb = sum(len(content) for content, _, _ in static_files().values()) / 1000
    heaviest_kb = max(size_kb for _, size_kb in pages.values()) + static_kb
    return [
        at_most(f"lost answers of {PEOPLE * ITEMS}, {PEOPLE} forms at once", lost, 0),
        at_least(f"durable answers, {PEOPLE} at once", rate, PEOPLE / 5, "1/s"),
        at_most("an answer among those, median", median(answer_ms), 5000, "ms"),
        *(at_most(f"{name}, median", ms, PAGE_MS, "ms") for name, (ms, _) in pages.items()),
        at_most(f"heaviest page with its {len(STATIC_TYPES)} files", heaviest_kb, PAGE_KB, "kB"),
    ]


def _enrol(folder: Path) -> dict[str, str]:
    """People who have agreed; their links' tokens by id."""
    tokens: dict[str, str] = {}
    with Study.open(folder) as study:
        for _ in range(PEOPLE):
            who = study.enrol(Role.TRAINING).id
            study.consent(who, given=True)
            tokens[who] = study.new_link(who)
    return tokens


@contextmanager
def _console(folder: Path) -> Iterator[tuple[str, str]]:
    """``steerlab console``: its address, and the link by which the experimenter signs in."""
    command = [sys.executable, "-m", "steerlab.teleop.cli", "console", str(folder), "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        found = re.search(r"(http://[^/]+)/enter/\S+", process.stdout.readline())
        if found is None:
            raise SystemExit("The console did not start.")
        yield found.group(1), found.group(0)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def _load(address: str, folder: Path, tokens: Mapping[str, str]) -> tuple[int, list[float], float]:
    """Everyone answers the same questionnaire as fast as they can.

    Returns:
        answers that are not kept as given, milliseconds of each, answers per second.
    """
    took_ms: list[float] = []
    given = {
        who: {f"i{item:02d}": (place + item) % 5 + 1 for item in range(1, ITEMS + 1)}
        for place, who in enumerate(tokens)
    }

    async def fill(client: httpx.AsyncClient, who: str) -> None:
        token = tokens[who]
        for item, value in given[who].items():
            started = perf_counter()
            answer = await client.post(
                f"/p/{token}/{PHASE}/{PART}/answer",
                data={"csrf": csrf_token(token), "item": item, "value": str(value)},
            )
            answer.raise_for_status()
            took_ms.append(1e3 * (perf_counter() - started))

    async def everybody() -> None:
        limits = httpx.Limits(max_connections=PEOPLE)
        async with httpx.AsyncClient(
            base_url=address, headers={"origin": address}, limits=limits, timeout=120
        ) as client:
            await asyncio.gather(*(fill(client, who) for who in tokens))

    started = perf_counter()
    asyncio.run(everybody())
    seconds = perf_counter() - started
    with Study.open(folder, read_only=True) as study:
        lost = 0
        for who, answers in given.items():
            phase = next(one for one, _ in study.participant(who).phases if one.id == PHASE)
            kept = study.answers(who, PHASE, phase.questionnaires[PART - 1])
            lost += sum(kept.get(item) != value for item, value in answers.items())
    return lost, took_ms, len(took_ms) / seconds


def _pages(address: str, sign_in: str, token: str) -> dict[str, tuple[float, float]]:
    """Median milliseconds until a page is there, and its kilobytes, by what it is."""
    paths = {
        "a questionnaire": f"/p/{token}/{PHASE}/{PART}",
        f"list of {PEOPLE} participants": "/",
        "one participant": "/participants/T001",
        "checks": "/checks",
    }
    found: dict[str, tuple[float, float]] = {}
    with httpx.Client(base_url=address) as client:
        client.get(sign_in)
        for name, path in paths.items():
            took_ms: list[float] = []
            size_kb = 0.0
            for _ in range(VISITS):
                started = perf_counter()
                answer = client.get(path)
                took_ms.append(1e3 * (perf_counter() - started))
                answer.raise_for_status()
                size_kb = len(answer.content) / 1000
            found[name] = (median(took_ms), size_kb)
    return found


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
