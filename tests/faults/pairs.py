"""Two commands that meet on one study, or on one place for results: both end well, or in a sentence."""

import json
import random
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import httpx

from steerlab.sim.calibration_set import read_rollouts
from steerlab.study.contract import Role
from steerlab.study.derived import left_of
from steerlab.study.store.answers import read_responses
from steerlab.study.study import Study
from steerlab.study.withdrawal import traces
from tests.faults.kills import _leftovers
from tests.study.conftest import ROLLOUTS, _run_scripted, edit, make_small

SECRET = "Quokka of {who}"  # a note
TOKEN = "token.txt"
LONGEST_S = 300.0
_LOOK_S = 0.02
_NEVER = r"(?!)"
Check = Callable[[Path], list[str]]
Row = tuple[object, ...]


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two commands of ``steerlab`` that are run at about the same time in one folder.

    Attributes:
        commands: a console is told to end once the other has ended.
        prepare: makes what they work on; its result is copied for each meeting.
        erased: whom one of them erases.
        stays: what may be said again to a command that was refused and is then run alone.
        bad: what ``study verify`` may find while the other is at work.
        check: what is wrong in the end, besides a study's own.
    """

    name: str
    commands: tuple[str, str]
    prepare: Callable[[Path], None]
    erased: str | None = None
    stays: str = _NEVER
    bad: str = _NEVER
    check: Check = lambda folder: []


@dataclass
class Meetings:
    """What came of them; ``refusals`` are the sentences, without what differs from run to run."""

    refused: int = 0
    refusals: set[str] = field(default_factory=set)
    broken: list[str] = field(default_factory=list)


def meet_often(pair: Pair, room: Path, times: int, seed: int) -> Meetings:
    """Let them meet so often; the second starts at a moment drawn over the time the first takes."""
    rng, meetings, took_s = random.Random(f"{pair.name}-{seed}"), Meetings(), [2.0, 2.0]
    original = room / pair.prepare.__name__
    if not original.exists():
        original.mkdir(parents=True)
        pair.prepare(original)
    for number in range(times):
        folder = Path(shutil.copytree(original, room / f"{pair.name} {number}"))
        offset_s = rng.uniform(-took_s[1], took_s[0])
        before = _rows(folder, pair.erased)
        sides = [_Side(command, folder, f"{n}") for n, command in enumerate(pair.commands)]
        earlier, later = sides if offset_s >= 0.0 else reversed(sides)
        problems = _run(earlier, later, abs(offset_s))
        for place, side in enumerate(sides):
            problems += side.wrong(pair.bad)
            if side.code == 0:
                took_s[place] = side.took_s
            elif side.code == 2:
                meetings.refused += 1
                meetings.refusals.add(re.sub(r"/\S+/|\d+", "…", side.said))
                problems += _alone(side.command, folder, pair.stays)
        problems += [*_study(folder, pair.erased, before), *pair.check(folder), *_leftovers(folder)]
        what = f"{pair.name} {number}, the second after {offset_s:.2f} s"
        meetings.broken += [f"{what}: {why}" for why in problems]
        shutil.rmtree(folder)
    return meetings


class _Side:
    """One of the two, a process that is run in ``folder``.

    Attributes:
        code: how it ended; None before.
        statuses: of the participant's page, asked for as long as a console serves it.
    """

    def __init__(self, command: str, folder: Path, name: str) -> None:
        self.command = command
        self.code: int | None = None
        self.took_s = 0.0
        self.statuses: set[int] = set()
        self._folder = folder
        self._out, self._err = folder / f"{name}.out", folder / f"{name}.err"
        self._told = False

    def start(self) -> None:
        """Start it."""
        command = [sys.executable, "-m", "steerlab.app.cli", *self.command.split()]
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self._process = subprocess.Popen(command, cwd=self._folder, stdout=out, stderr=err)
        self._began = perf_counter()

    def look(self, other: "_Side | None") -> None:
        """See whether it has ended; use a console, and end it after the ``other``."""
        if self.code is not None:
            return
        self.code = self._process.poll()
        self.took_s = perf_counter() - self._began
        if self.command.startswith("console") and self.code is None and not self._told:
            found = re.search(r"(http://\S+)/enter/", self._out.read_text(encoding="utf-8"))
            if found is None:
                return
            page = f"{found[1]}/p/{(self._folder / TOKEN).read_text()}"
            self.statuses.add(httpx.get(page, follow_redirects=True, timeout=60).status_code)
            if other is None or other.code is not None:
                self._process.send_signal(signal.SIGINT)
                self._told = True

    def kill(self) -> None:
        """End what does not end."""
        self._process.kill()
        self.code = self._process.wait()

    @property
    def said(self) -> str:
        """On stderr."""
        return self._err.read_text(encoding="utf-8").strip()

    def wrong(self, bad: str) -> list[str]:
        """What is wrong with how it ended, and with what it said."""
        lines = self.said.splitlines()
        sentence = len(lines) == 1 and lines[0].startswith("steerlab: ")
        fine = (self.code == 0 and not lines) or (self.code == 2 and sentence)
        if self.command == _VERIFY and self.code == 1:
            found = self._out.read_text(encoding="utf-8").splitlines()
            lines = [line for line in found if line.startswith("BAD")]
            fine = all(re.search(bad, line) for line in lines)
        problems = [] if fine else [f"`{self.command}` ended with {self.code}: {lines[-12:]}"]
        strange = sorted(self.statuses - {200, 503})
        return [*problems, *(f"the console answered {status}" for status in strange)]


def _run(earlier: _Side, later: _Side | None = None, after_s: float = 0.0) -> list[str]:
    """Run one, or both, to the end; what is wrong with that."""
    earlier.start()
    sides = [earlier]
    if later is not None:
        sleep(after_s)
        later.start()
        sides.append(later)
    began = perf_counter()
    while any(side.code is None for side in sides):
        earlier.look(later)
        if later is not None:
            later.look(earlier)
        if perf_counter() - began > LONGEST_S:
            stuck = [side for side in sides if side.code is None]
            for side in stuck:
                side.kill()
            return [f"`{side.command}` did not end" for side in stuck]
        sleep(_LOOK_S)
    return []


def _alone(command: str, folder: Path, stays: str = _NEVER) -> list[str]:
    """Whoever was refused can do it when the other has ended."""
    side = _Side(command, folder, "alone")
    problems = _run(side)
    if problems or side.code == 0 or (side.code == 2 and re.search(stays, side.said)):
        return problems
    return [f"`{command}` alone then ends with {side.code}: {side.said[-600:]}"]


def _rows(folder: Path, erased: str | None) -> set[Row]:
    """What is on record: the audit, and answers and labels of whoever stays."""
    if not (folder / "study" / "study.db").exists():
        return set()
    with Study.open(folder / "study", read_only=True) as study:
        store = study._opened.store
        rows: set[Row] = {("audit", entry.id, entry.sha256) for entry in store.audit()}
        rows |= {
            ("answer", one.participant, one.id, one.item, one.value)
            for one in read_responses(store.connection)
        }
        for attempt in store.attempts():
            labels = sha256(str(store.steps(attempt).to_pylist()).encode())
            rows.add(("attempt", *attempt.key, labels.hexdigest()))
    return {row for row in rows if row[1] != erased}


def _study(folder: Path, erased: str | None, before: set[Row]) -> list[str]:
    """What is wrong with a study when both have ended."""
    path = folder / "study"
    if not (path / "study.db").exists():
        return []
    wrong = _findings(path)
    lost = sorted(map(str, before - _rows(folder, erased)))
    wrong += [f"{len(lost)} rows are lost, such as {lost[0]}"] if lost else []
    if erased is not None:
        left = {*left_of(path, erased), *traces(path, erased)}
        wrong += [f"{one.relative_to(folder)} still holds {erased}" for one in sorted(left)]
        wrong += [
            f"{one.relative_to(folder)} still holds a note about {erased}"
            for one in sorted(path.rglob("*"))
            if one.is_file() and SECRET.format(who=erased).encode() in one.read_bytes()
        ]
    return wrong


def nothing(folder: Path) -> None:
    """No study."""


def trained(folder: Path) -> None:
    """Three training participants, who have recordings; T001 has a link, and T004 has only come."""
    make_small(folder / "study")
    _train(folder)


def with_networks(folder: Path) -> None:
    """Three rollouts, so that ``analyze`` trains; the network is frozen."""
    make_small(folder / "study")
    edit(folder / "study", (ROLLOUTS, ROLLOUTS.replace("]", ', "calibration-03"]')))
    _train(folder)
    with Study.open(folder / "study") as study:
        study.train(lambda what, share: None)


def _train(folder: Path) -> None:
    with Study.open(folder / "study") as study:
        for seed in (1, 2, 3):
            _run_scripted(study, Role.TRAINING, seed)
        for who in ("T001", study.enrol(Role.TRAINING).id):
            study.note(who, SECRET.format(who=who))
        (folder / TOKEN).write_text(study.new_link("T001"))


def _whole(name: str, *, erased: bool = False) -> Check:
    """The page is there, to its end; an erasure after it may have taken it."""

    def check(folder: Path) -> list[str]:
        page = folder / name
        gone = erased and not page.parent.exists()
        whole = page.is_file() and page.read_text(encoding="utf-8").rstrip().endswith("</html>")
        return [] if whole or gone else [f"{name} is not whole"]

    return check


def _set_is_whole(folder: Path) -> list[str]:
    return [] if len(read_rollouts(folder / "set.parquet")) == 12 else ["the set is not whole"]


def _copy_is_whole(folder: Path) -> list[str]:
    return _findings(folder / "copy")


def _findings(study: Path) -> list[str]:
    with Study.open(study, read_only=True) as opened:
        return [f"{one.what}: {one.found}" for one in opened.verify().findings if not one.ok]


def _power_is_one(folder: Path) -> list[str]:
    """The figures are those of the settings that lie beside them, and of no others."""
    seed = json.loads((folder / "out" / "power.json").read_text(encoding="utf-8"))["seed"]
    problems = _alone(f"{_POWER} --seed {seed}".replace("--out out", "--out lone"), folder)
    found, lone = (
        json.loads((folder / name / "summary.json").read_text(encoding="utf-8"))["curves"]
        for name in ("out", "lone")
    )
    return [*problems, *([] if found == lone else [f"the figures are not those of seed {seed}"])]


_RUN, _ERASE = "study run study --teacher scripted:human:5", "study withdraw study T001 --erase"
_AS_T004, _ERASE_T004 = f"{_RUN} --participant T004", "study withdraw study T004 --erase"
_ANALYZE = "analyze study --seeds 0 --permutations 99"
_CONSOLE, _VERIFY = "console study --port 0", "study verify study"
_ENROL, _NOTE = "study enrol study --role training", "study note study --text x --participant T001"
_REPLAY = "replay study --no-pictures --save study/all.rrd"
_EXPORT, _BACKUP = "export study --format csv parquet", "study backup study copy"
_SET = "calibration-set --out set.parquet"
_SIMULATE = "simulate --teachers 3 --new-teachers 2 --rollouts 4 --ladder quick --out out"
_TEACH = "teach --learners bc --teachers 1 --rounds 1 --task easy --learner-seeds 1 --out out"
_POWER = "power --people 8 12 --studies 200 --out out"
_REPORT, _RESULTS = _whole("study/report/index.html"), _whole("out/report/index.html")
_REPORT_OR_NONE = _whole("study/report/index.html", erased=True)
_THERE = "is not empty|holds something else|exists"


def _pair(
    name: str, first: str, second: str, prepare: Callable[[Path], None] = trained, **more: Any
) -> Pair:
    return Pair(name=name, commands=(first, second), prepare=prepare, **more)


PAIRS = (
    _pair("two runs", _RUN, _RUN),
    _pair("two runs of one person", _AS_T004, _AS_T004),
    _pair("run and erase", _RUN, _ERASE, erased="T001"),
    _pair("run and erase the same", _AS_T004, _ERASE_T004, erased="T004"),
    _pair("run and analyze", _RUN, _ANALYZE, check=_REPORT),
    _pair("verify and run", _VERIFY, _RUN),
    _pair("status and run", "study status study", _RUN),
    _pair("verify and erase", _VERIFY, _ERASE, erased="T001", bad="T001 is not finished"),
    _pair("analyze and erase", _ANALYZE, _ERASE, erased="T001", check=_REPORT_OR_NONE),
    _pair("two analyses", _ANALYZE, _ANALYZE, check=_REPORT),
    _pair("replay and erase", _REPLAY, _ERASE, erased="T001"),
    _pair("export and erase", _EXPORT, _ERASE, erased="T001"),
    _pair("two exports", _EXPORT, _EXPORT),
    _pair("backup and run", _BACKUP, _RUN, check=_copy_is_whole),
    _pair("backup and erase", _BACKUP, _ERASE, erased="T001", check=_copy_is_whole),
    _pair("console and run", _CONSOLE, _RUN),
    _pair("console and analyze", _CONSOLE, _ANALYZE, check=_REPORT),
    _pair("console and erase", _CONSOLE, _ERASE, erased="T001"),
    _pair("two consoles", _CONSOLE, _CONSOLE),
    _pair("two enrolments", _ENROL, _ENROL),
    _pair("note and erase", _NOTE, _ERASE, erased="T001", stays="was erased"),
    _pair("two new studies", "study new study", "study new study", nothing, stays=_THERE),
)
"""Of commands that take seconds."""

LONG_PAIRS = (
    _pair(
        *("analyze and erase, with networks", "analyze study --permutations 99", _ERASE),
        *(with_networks,),
        erased="T001",
        check=_REPORT_OR_NONE,
    ),
    _pair("train and erase", "study train study", _ERASE, erased="T001", stays="is frozen since"),
    _pair("teach and erase", f"{_RUN} --role test", _ERASE, with_networks, erased="T001"),
    _pair("two powers", _POWER, f"{_POWER} --seed 1", nothing, stays=_THERE, check=_power_is_one),
    _pair("two sets", _SET, f"{_SET} --seed 13", nothing, stays=_THERE, check=_set_is_whole),
    _pair(
        *("two simulations", _SIMULATE, f"{_SIMULATE} --force", nothing),
        stays=_THERE,
        check=_RESULTS,
    ),
    _pair(
        *("two teachings", _TEACH, f"{_TEACH} --force --seed 1", nothing),
        stays=_THERE,
        check=_RESULTS,
    ),
)
"""Of commands that take longer."""
