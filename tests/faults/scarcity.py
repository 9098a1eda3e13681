"""Every verb that writes, with too little disk, too small files or too few handles: it says so."""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from time import sleep

from tests.faults.kills import Verb

PAGE = 4096  # bytes; a tmpfs gives whole pages
FEWEST_HANDLES = 5  # with fewer ``steerlab --version`` itself does not start
MOST_HANDLES = 64  # with as many every verb does all it does
HANGS_S = 600.0
_LOOK_S = 0.02


class Scarce(Enum):
    """What runs out."""

    DISK = "disk"
    FILE_SIZE = "file size"
    HANDLES = "handles"


_CAUSE_AND_MEND = {
    Scarce.DISK: r"(No space left|disk is full|disk I/O error).*room",
    Scarce.FILE_SIZE: r"(File too large|disk I/O error).*ulimit -f",
    Scarce.HANDLES: r"open files.*ulimit -n",
}

_WARNING = "The data is safe in study.db"  # about a recording, which can be made again


@dataclass(frozen=True, kw_only=True)
class Trial:
    """So much of it: bytes above what the folder holds, bytes a file, or handles."""

    scarce: Scarce
    amount: int

    def __str__(self) -> str:
        return f"{self.amount} {'' if self.scarce is Scarce.HANDLES else 'bytes of '}{self.scarce.value}"


@dataclass(frozen=True, kw_only=True)
class Needs:
    """What a run takes that has enough, in bytes: all that it writes, and its largest file."""

    disk: int
    file_size: int

    def draw(self, scarce: Scarce, rng: random.Random) -> Trial:
        """An amount from nearly nothing to just enough, more often a small one."""
        few, most = {
            Scarce.DISK: (PAGE, self.disk),
            Scarce.FILE_SIZE: (512, self.file_size),
            Scarce.HANDLES: (FEWEST_HANDLES, MOST_HANDLES),
        }[scarce]
        return Trial(scarce=scarce, amount=few + round((most - few) * rng.random() ** 2))


@dataclass
class Report:
    """What came of it: trials of each kind, how many were refused in words, and what broke."""

    tried: Counter[Scarce] = field(default_factory=Counter)
    refused: int = 0
    broken: list[str] = field(default_factory=list)


def starve(verb: Verb, room: Path, trials: int, seed: int) -> Report:
    """Run ``verb`` so often with too little, of each kind in turn, and let it finish after the last.

    The kinds come one after the other in the same folder until the verb gets by.
    """
    rng, report = random.Random(f"{verb.name}-{seed}"), Report()
    original = prepared(verb, room)
    needs, problems = _seen_whole(verb, original, room / "whole")
    report.broken += [f"{verb.name}: {why}" for why in problems]
    kinds = [kind for kind in Scarce if kind is not Scarce.DISK or not no_small_disk()]
    while (done := report.tried.total()) < trials:
        drawn = [needs.draw(kind, rng) for kind in rng.sample(kinds, len(kinds))]
        drawn = drawn[: trials - done]
        codes, problems = try_in_turn(verb, drawn, original, room / f"{done}")
        report.tried.update(trial.scarce for trial in drawn[: len(codes)])
        report.refused += codes.count(2)
        report.broken += problems
    return report


def prepared(verb: Verb, room: Path) -> Path:
    """What the verb works on."""
    original = room / "original"
    original.mkdir(parents=True)
    verb.prepare(original)
    return original


def try_in_turn(
    verb: Verb, trials: Sequence[Trial], original: Path, folder: Path
) -> tuple[list[int], list[str]]:
    """Run with too little until it gets by, look each time, run with enough, look.

    Returns:
        exit codes of the trials, and what is wrong, in sentences.
    """
    shutil.copytree(original, folder)
    codes: list[int] = []
    broken: list[str] = []
    for trial in trials:
        ended = _run_scarce(verb, trial, folder)
        problems = [*_told(ended, trial.scarce), *_seen(verb.check, folder), *_leftovers(folder)]
        broken += [f"{verb.name} with {trial}: {why}" for why in problems]
        codes.append(ended.returncode)
        if ended.returncode == 0:
            break
    was = f"{verb.name} after {', '.join(map(str, trials[: len(codes)]))}"
    if codes[-1] != 0 and not (verb.name == "study new" and (folder / "study/study.db").exists()):
        enough = _finish(_start(_command(verb), folder))  # a study that is there is refused
        if enough.returncode != 0:
            broken.append(f"{was}, {enough.returncode} with enough: {enough.stderr.strip()[-900:]}")
    broken += [f"{was}: {why}" for why in (*_seen(verb.done, folder), *_leftovers(folder))]
    shutil.rmtree(folder)
    return codes, broken


@cache
def no_small_disk() -> str:
    """Why no small disk can be mounted here; empty if it can."""
    if shutil.which("unshare") is None:
        return "no small disk: there is no unshare"
    tried = subprocess.run(
        [*_unshare(), "sh", "-c", "mount -t tmpfs none /mnt"],
        capture_output=True,
        text=True,
        check=False,
    )
    return f"no small disk: {tried.stderr.strip()}" if tried.returncode else ""


def _unshare() -> list[str]:
    """A mount namespace of its own: what is mounted in it goes with its last process."""
    return ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]


_ON_SMALL_DISK = """
folder=$PWD disk=$PWD.disk size=$1
shift
mkdir "$disk" && mount -t tmpfs -o size="$size" none "$disk" && cp -a "$folder/." "$disk" || exit 99
cd "$disk"
"$@"
ended=$?
cd "$folder" && find . -mindepth 1 -delete && cp -a "$disk/." . || exit 99
exit $ended
"""


def _run_scarce(verb: Verb, trial: Trial, folder: Path) -> subprocess.CompletedProcess[str]:
    command = _command(verb)
    if trial.scarce is Scarce.DISK:
        size = str(_pages(folder) + trial.amount)
        command = [*_unshare(), "sh", "-c", _ON_SMALL_DISK, "sh", size, *command]
        ended = _finish(_start(command, folder))
        Path(f"{folder}.disk").rmdir()
        return ended
    return _finish(_start(command, folder, _limit(trial)))


def _limit(trial: Trial) -> Callable[[], None]:
    """Sets the limit, in the child."""
    import resource  # POSIX alone has it

    kinds = {Scarce.FILE_SIZE: resource.RLIMIT_FSIZE, Scarce.HANDLES: resource.RLIMIT_NOFILE}
    return lambda: resource.setrlimit(kinds[trial.scarce], (trial.amount, trial.amount))


def _command(verb: Verb) -> list[str]:
    # -B: Python 3.11 keeps the half of a .pyc that a limit lets through, and then cannot import it.
    return [sys.executable, "-B", "-m", "steerlab.app.cli", *verb.arguments]


def _start(
    command: list[str], folder: Path, limit: Callable[[], None] | None = None
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        start_new_session=True,
        preexec_fn=limit,
    )


def _finish(running: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
    """Wait for it; what takes ``HANGS_S`` is killed, with what it started."""
    try:
        said, wrong = running.communicate(timeout=HANGS_S)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        said, wrong = running.communicate()
    return subprocess.CompletedProcess(running.args, running.returncode, said, wrong)


def _told(ended: subprocess.CompletedProcess[str], scarce: Scarce) -> Iterator[str]:
    """What is wrong about how it ended, and what it said."""
    said = ended.stderr.strip()
    lines = said.splitlines()
    if ended.returncode not in (0, 2):
        yield f"ended with {ended.returncode}: {said[-1500:]}"
    elif foreign := [line for line in lines if not line.startswith("steerlab: ")]:
        yield f"a library spoke: {foreign[0][:300]} ... {said[-1500:]}"
    elif ended.returncode == 2:
        told = [line for line in lines if re.search(_CAUSE_AND_MEND[scarce], line)]
        if not lines or lines[-1] not in told:
            yield f"does not end with cause and mend: {said[-1500:]}"
        if len([line for line in told if _WARNING not in line]) > 1:
            yield f"says it more than once: {said[-1500:]}"
    if "internal error" in said.lower():
        yield f"calls it an internal error: {said}"


def _seen(look: Callable[[Path], list[str]], folder: Path) -> list[str]:
    try:
        return look(folder)
    except Exception as error:  # what cannot be looked at is wrong, and no reason to end
        return [f"cannot be looked at: {type(error).__name__}: {error}"]


def _leftovers(folder: Path) -> list[str]:
    left = [path for path in folder.rglob(".*") if path.name.endswith(".part")]
    return [f"{path.relative_to(folder)} is left" for path in left]


def _seen_whole(verb: Verb, original: Path, folder: Path) -> tuple[Needs, list[str]]:
    """What a run with enough takes at most, and what is wrong after it."""
    shutil.copytree(original, folder)
    before, disk = _pages(folder), 0
    running = _start(_command(verb), folder)
    while running.poll() is None:
        disk = max(disk, _pages(folder))
        sleep(_LOOK_S)
    ended = _finish(running)
    problems = [f"ends with {ended.returncode}: {ended.stderr}"] if ended.returncode else []
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    needs = Needs(disk=max(disk, _pages(folder)) - before, file_size=max(sizes, default=0))
    return needs, [*problems, *_seen(verb.done, folder)]


def _pages(folder: Path) -> int:
    """Bytes that a tmpfs takes for all files in it."""
    sizes = []
    for parent, _, names in os.walk(folder):
        for name in names:
            try:
                sizes.append(Path(parent, name).lstat().st_size)
            except FileNotFoundError:  # a run goes on meanwhile
                continue
    return sum(-(-size // PAGE) * PAGE for size in sizes)
