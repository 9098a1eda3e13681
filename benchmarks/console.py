"""Pages of the console over a real study: 34 people who have finished, and fifty who answer.

``python -m benchmarks.console``; the 34 take about 40 s. Pages are timed from the request to the
last byte, first with nothing else to do, then while the fifty give an answer every two seconds
each and the whole study is checked as often.
"""

import asyncio
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter

import httpx

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.app.console.guard import csrf_token
from steerlab.app.console.rendering import STATIC_TYPES, static_files
from steerlab.study.contract import Role
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

FINISHED = 34  # as many as taught in the paper
PEOPLE = 50
ANSWER_EVERY_S = 2.0  # each of them
PHASE, PART, ITEMS = "about-you", 2, 20  # the Mini-IPIP of the shipped protocol
CHECK_EVERY = 50  # answers: each other second the whole study is checked
VISITS = 40
PAGE_MS = 100.0
PAGE_KB = 100.0


def run() -> list[Row]:
    """One row a figure."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study"
        new_study(study, "mind-meld")
        _finish(study)
        tokens = _enrol(study)
        with Study.open(study, read_only=True) as opened:
            started = perf_counter()
            opened.findings(None)
            checks_ms = 1e3 * (perf_counter() - started)
        with _console(study) as (address, sign_in):
            lost, answer_ms, rate = _load(address, study, tokens)
            with httpx.Client(base_url=address) as client:
                home = client.get(sign_in).headers["location"]
                ((cookie, session),) = client.cookies.items()
            visit = _Visit(address, home, cookie, session, tokens)
            alone, busy = asyncio.run(visit.pages(busy=False)), asyncio.run(visit.pages(busy=True))
    static_kb = sum(len(content) for content, _, _ in static_files().values()) / 1000
    heaviest_kb = max(size_kb for _, size_kb in alone.values()) + static_kb
    return [
        at_most(f"lost answers of {PEOPLE * ITEMS}, {PEOPLE} forms at once", lost, 0),
        at_least(f"durable answers, {PEOPLE} at once", rate, PEOPLE / 5, "1/s"),
        at_most("an answer among those, median", median(answer_ms), 5000, "ms"),
        *(at_most(f"{name}, p95", ms[-1], PAGE_MS, "ms") for name, (ms, _) in alone.items()),
        *(at_most(f"{name}, busy", median(ms), PAGE_MS, "ms") for name, (ms, _) in busy.items()),
        at_most("all checks of the study", checks_ms, 1000, "ms"),
        at_most(f"heaviest page with its {len(STATIC_TYPES)} files", heaviest_kb, PAGE_KB, "kB"),
    ]


def _finish(folder: Path) -> None:
    """Scripted training participants who have gone all the way."""
    with Study.open(folder) as study:
        for seed in range(FINISHED):
            script = ScriptedParticipant(kind="human", seed=seed)
            config = RunConfig(device=script.device, pages=script, recordings=False)
            study.run(study.enrol(Role.TRAINING).id, config)


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
    command = [sys.executable, "-m", "steerlab.app.cli", "console", str(folder), "--port", "0"]
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


class _Visit:
    """The experimenter and a participant look at their pages."""

    def __init__(
        self, address: str, home: str, cookie: str, session: str, tokens: Mapping[str, str]
    ) -> None:
        self._address = address
        self._home = home
        self._cookie = cookie
        self._session = session
        self._tokens = list(tokens.values())

    async def pages(self, *, busy: bool) -> dict[str, tuple[list[float], float]]:
        """Twentieths of the milliseconds until a page is there, and its kilobytes, by page."""
        token = self._tokens[0]
        paths = {
            "a questionnaire": f"/p/{token}/{PHASE}/{PART}",
            f"list of {FINISHED + PEOPLE} participants": self._home,
            "a finished participant": f"{self._home}/participants/T001",
            "one who answers": f"{self._home}/participants/T{FINISHED + 1:03d}",
            "checks": f"{self._home}/checks",
        }
        found: dict[str, tuple[list[float], float]] = {}
        async with httpx.AsyncClient(
            base_url=self._address,
            headers={"origin": self._address, "cookie": f"{self._cookie}={self._session}"},
            limits=httpx.Limits(max_connections=PEOPLE),
            timeout=120,
        ) as client:
            others = [asyncio.create_task(self._work(client))] if busy else []
            for name, path in paths.items():
                took_ms: list[float] = []
                size_kb = 0.0
                for _ in range(VISITS):
                    await asyncio.sleep(0.05)
                    started = perf_counter()
                    answer = await client.get(path)
                    took_ms.append(1e3 * (perf_counter() - started))
                    answer.raise_for_status()
                    size_kb = len(answer.content) / 1000
                found[name] = (quantiles(took_ms, n=20), size_kb)
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)
        return found

    async def _work(self, client: httpx.AsyncClient) -> None:
        """Answers, evenly in time, and one check after another."""
        async with asyncio.TaskGroup() as group:
            for number in range(10**9):
                token = self._tokens[number % PEOPLE]
                value = str(number // PEOPLE % 5 + 1)
                answer = {"csrf": csrf_token(token), "item": "i05", "value": value}
                path = f"/p/{token}/{PHASE}/{PART}/answer"
                group.create_task(_post(client, path, answer))
                if number % CHECK_EVERY == 0:
                    form = {"csrf": csrf_token(self._session)}
                    group.create_task(_post(client, f"{self._home}/checks", form))
                await asyncio.sleep(ANSWER_EVERY_S / PEOPLE)


async def _post(client: httpx.AsyncClient, path: str, fields: dict[str, str]) -> None:
    answer = await client.post(path, data=fields)
    if answer.status_code not in (204, 303):
        answer.raise_for_status()


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
