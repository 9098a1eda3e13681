"""Every verb that writes, killed at a random moment: nothing is half, nothing that was kept is lost."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from importlib.resources import as_file, files
from pathlib import Path
from time import perf_counter, sleep

from steerlab.sim.calibration_set import read_rollouts
from steerlab.study.contract import Role
from steerlab.study.derived import left_of
from steerlab.study.study import Study

TABLE = Path(__file__).parents[2] / "docs" / "example-labels.csv"
IN_TURN = 2
Check = Callable[[Path], list[str]]


@dataclass(frozen=True, kw_only=True)
class Verb:
    """A command that writes.

    Attributes:
        arguments: of ``steerlab``, run in a folder of its own.
        prepare: makes what the command works on; its result is copied for each kill.
        check: what is wrong after a kill, in sentences; also called when all is done.
        done: what is wrong after the same command has then run to its end.
        guess_s: how long it takes, before one was seen to its end.
    """

    name: str
    arguments: tuple[str, ...]
    check: Check
    done: Check
    guess_s: float
    prepare: Callable[[Path], None] = lambda folder: None


@dataclass
class Report:
    """What came of it."""

    kills: int = 0
    broken: list[str] = field(default_factory=list)


def kill_often(verb: Verb, room: Path, kills: int, seed: int) -> Report:
    """Kill ``verb`` so often, and let it finish after every ``IN_TURN`` kills in one folder.

    Moments are drawn over the time that the last run to the end took, at first over ``verb.guess_s``.
    """
    rng, report, took_s = random.Random(f"{verb.name}-{seed}"), Report(), verb.guess_s
    original = room / "original"
    original.mkdir(parents=True)
    verb.prepare(original)
    for first in range(0, kills, IN_TURN):
        folder = Path(shutil.copytree(original, room / f"{first}"))
        moments = [rng.uniform(0.0, 1.1 * took_s) for _ in range(min(IN_TURN, kills - first))]
        problems: list[str] = []
        for after_s in moments:
            report.kills += _killed(verb, folder, after_s)
            problems += verb.check(folder)
        began = perf_counter()
        if not (verb.name == "study new" and (folder / "study" / "study.db").exists()):
            problems += _run(verb, folder)  # which is refused where there is a study already
            took_s = perf_counter() - began
        problems += [*verb.done(folder), *_leftovers(folder)]
        after = " and ".join(f"{after_s:.2f}" for after_s in moments)
        report.broken += [f"{verb.name}, killed after {after} s: {why}" for why in problems]
        shutil.rmtree(folder)
    return report


def _command(verb: Verb) -> list[str]:
    return [sys.executable, "-m", "steerlab.app.cli", *verb.arguments]


def _run(verb: Verb, folder: Path) -> list[str]:
    done = subprocess.run(
        _command(verb), cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False
    )
    if done.returncode == 0:
        return []
    return [f"the same command then ends with {done.returncode}: {done.stderr.strip()[-600:]}"]


def _killed(verb: Verb, folder: Path, after_s: float) -> bool:
    """Whether it was still running."""
    with subprocess.Popen(
        _command(verb),
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as running:
        sleep(after_s)
        alive = running.poll() is None
        if alive:
            os.killpg(running.pid, signal.SIGKILL)
        return alive


def _leftovers(folder: Path) -> list[str]:
    left = [path for path in folder.rglob(".*") if path.name.endswith(".part")]
    return [f"{path.relative_to(folder)} is left for ever" for path in left]


def _results(name: str) -> tuple[Check, Check]:
    """Checks of a folder that is whole or not there."""

    def check(folder: Path) -> list[str]:
        return done(folder) if (folder / name).exists() else []

    def done(folder: Path) -> list[str]:
        missing = [
            part
            for part in ("summary.json", "report/index.html")
            if not (folder / name / part).is_file()
        ]
        if missing:
            return [f"{name} lacks {', '.join(missing)}"]
        json.loads((folder / name / "summary.json").read_text(encoding="utf-8"))
        page = (folder / name / "report" / "index.html").read_text(encoding="utf-8")
        return [] if page.rstrip().endswith("</html>") else ["the report is cut off"]

    return check, done


def _goes_on(name: str) -> tuple[Check, Check]:
    """Checks of a folder in which a run goes on: its files are whole, and the summary stands for all."""
    done = _results(name)[1]

    def check(folder: Path) -> list[str]:
        for path in (folder / name).rglob("*.json"):
            json.loads(path.read_text(encoding="utf-8"))
        return done(folder) if (folder / name / "summary.json").exists() else []

    return check, done


def _rollouts(folder: Path) -> list[str]:
    path = folder / "set.parquet"
    return [] if len(read_rollouts(path)) == 12 else [f"{path.name} holds other rollouts"]


def _small_study(folder: Path) -> None:
    from tests.study.conftest import make_small

    make_small(folder / "study")
    with Study.open(folder / "study") as study:
        study.enrol(Role.TRAINING)


def _trained_study(folder: Path) -> None:
    from tests.study.conftest import _run_scripted, make_small

    make_small(folder / "study")
    with Study.open(folder / "study") as study:
        for seed in (1, 2, 3):
            _run_scripted(study, Role.TRAINING, seed)


def _study(folder: Path) -> list[str]:
    """A study that nobody works in: all that is kept is as it was kept."""
    if not (folder / "study" / "study.db").exists():
        return []
    with Study.open(folder / "study", read_only=True) as study:
        wrong = [c for c in study.verify().findings if not c.ok and c.what in _KEPT]
    return [f"{check.what}: {check.found}" for check in wrong]


_KEPT = ("Database", "Audit", "Answers", "Labels", "Protocol", "Network", "Embeddings")


def _labelled(folder: Path) -> list[str]:
    with Study.open(folder / "study", read_only=True) as study:
        labels = study._opened.store.read_labels()
    few = len(set(labels["rollout"].to_pylist())) < 2
    return [*_study(folder), *(["not all rollouts were corrected"] if few else [])]


def _erased(folder: Path) -> list[str]:
    left = [str(path.relative_to(folder)) for path in left_of(folder / "study", "T001")]
    with Study.open(folder / "study", read_only=True) as study:
        wrong = [c.found for c in study.verify().findings if not c.ok and c.what == "Withdrawal"]
    return [*_study(folder), *(f"{path} still holds T001" for path in left), *wrong]


def _analysed(folder: Path) -> list[str]:
    page = folder / "study" / "report" / "index.html"
    whole = page.is_file() and page.read_text(encoding="utf-8").rstrip().endswith("</html>")
    return [*_study(folder), *([] if whole else ["there is no whole report"])]


def _no_half_export(folder: Path) -> list[str]:
    found = list((folder / "study").glob("exports/[!.]*"))
    half = [place.name for place in found if not _is_whole(place)]
    return [*_study(folder), *(f"export {name} is not whole" for name in half)]


def _is_whole(place: Path) -> bool:
    """All files of an export are there, as its summary has their hashes."""
    if not (place / "summary.json").is_file():
        return False
    summary = json.loads((place / "summary.json").read_bytes())
    there = [path for path in place.rglob("*") if path.is_file() and path.name != "summary.json"]
    return summary["files"] == {
        path.relative_to(place).as_posix(): sha256(path.read_bytes()).hexdigest() for path in there
    }


def _exported(folder: Path) -> list[str]:
    there = (folder / "study" / "exports" / "csv+spss").is_dir()
    return [*_no_half_export(folder), *([] if there else ["there is no export"])]


def _no_half_copy(folder: Path) -> list[str]:
    return [*_study(folder), *(_copied(folder) if (folder / "copy").exists() else [])]


def _copied(folder: Path) -> list[str]:
    with Study.open(folder / "copy", read_only=True) as study:
        return [f"the copy: {c.found}" for c in study.verify().findings if not c.ok]


def _no_half_video(folder: Path) -> list[str]:
    return [*_study(folder), *(_filmed(folder) if (folder / "study" / "one.mp4").exists() else [])]


def _filmed(folder: Path) -> list[str]:
    import av

    with av.open(str(folder / "study" / "one.mp4")) as video:
        frames = sum(1 for _ in video.decode(video=0))
    return [] if frames > 100 else [f"the video has {frames} frames"]


def _begun(folder: Path) -> list[str]:
    with Study.open(folder / "study", read_only=True) as study:
        return [] if study.title else ["the study has no title"]


def _copy_set(folder: Path) -> None:
    with as_file(files("steerlab.assets") / "calibration_set.parquet") as path:
        shutil.copy(path, folder / "set.parquet")


def _verb(
    name: str,
    arguments: str,
    checks: tuple[Check, Check],
    guess_s: float,
    prepare: Callable[[Path], None] = lambda folder: None,
) -> Verb:
    return Verb(
        name=name,
        arguments=tuple(arguments.split()),
        check=checks[0],
        done=checks[1],
        guess_s=guess_s,
        prepare=prepare,
    )


VERBS = (
    _verb(
        "simulate",
        "simulate --teachers 3 --new-teachers 2 --rollouts 4 --ladder quick --out out --force",
        _results("out"),
        10.0,
    ),
    _verb("demo", "demo --out out --force", _results("out"), 25.0),
    _verb("fit", f"fit {TABLE} --folds 2 --ladder quick --out out --force", _results("out"), 10.0),
    _verb(
        "synthetic",
        "synthetic --people 6 --new-people 4 --out out --force",
        _results("out"),
        15.0,
    ),
    _verb(
        "teach",
        "teach --learners bc --teachers 1 --rounds 1 --task easy --learner-seeds 1 --seed 101 --out out",
        _goes_on("out"),
        10.0,
    ),
    _verb("power", "power --people 8 12 --studies 200 --out out", _goes_on("out"), 2.0),
    _verb(
        "calibration-set",
        "calibration-set --out set.parquet --force",
        (_rollouts, _rollouts),
        8.0,
        _copy_set,
    ),
    _verb("study new", "study new study", (_study, _begun), 1.0),
    _verb(
        "study run",
        "study run study --participant T001 --teacher scripted:human:5",
        (_study, _labelled),
        5.0,
        _small_study,
    ),
    _verb("erase", "study withdraw study T001 --erase", (_study, _erased), 1.0, _trained_study),
    _verb("analyze", "analyze study --force", (_study, _analysed), 6.0, _trained_study),
    _verb(
        "export",
        "export study --format csv spss",
        (_no_half_export, _exported),
        4.0,
        _trained_study,
    ),
    _verb("backup", "study backup study copy", (_no_half_copy, _copied), 2.0, _trained_study),
    _verb(
        "video",
        "replay study --participant T001 --video study/one.mp4",
        (_no_half_video, _filmed),
        8.0,
        _trained_study,
    ),
    _verb("replay", "replay study --save study/all.rrd", (_study, _study), 6.0, _trained_study),
)
