"""One seed gives the same files, whatever surrounds the program."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = {"PYTHONHASHSEED": "0", "TZ": "UTC", "OMP_NUM_THREADS": "1", "LC_ALL": "C.UTF-8"}
ELSEWHERE = {"PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "OMP_NUM_THREADS": "2", "LC_ALL": "C"}
CHANGING = ("seconds", "versions")  # of a summary: how long it took, and with what


def _run(folder: Path, arguments: str, surroundings: dict[str, str]) -> dict[str, bytes]:
    folder.mkdir()
    command = [sys.executable, "-m", "steerlab.app.cli", *arguments.split(), "--out", "out"]
    done = subprocess.run(
        command,
        cwd=folder,
        env=os.environ | surroundings,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    files: dict[str, bytes] = {}
    for path in sorted((folder / "out").rglob("*")):
        name = str(path.relative_to(folder / "out"))
        if path.name == "summary.json":
            values = json.loads(path.read_text(encoding="utf-8"))
            kept = {key: value for key, value in values.items() if key not in CHANGING}
            files[name] = json.dumps(kept, sort_keys=True).encode()
        elif path.is_file() and path.suffix not in (".html", ".pid"):  # pages show the seconds
            files[name] = path.read_bytes()
    return files


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "elsewhere"),
    [
        (
            "power --people 8 12 --studies 200 --jobs 1",
            "power --people 8 12 --studies 200 --jobs 2",
        ),
        (
            "simulate --teachers 3 --new-teachers 2 --rollouts 4 --ladder quick --seed 5",
            "simulate --teachers 3 --new-teachers 2 --rollouts 4 --ladder quick --seed 5",
        ),
    ],
    ids=["power", "simulate"],
)
def test_surroundings_change_nothing(tmp_path, arguments, elsewhere):
    here = _run(tmp_path / "here", arguments, HERE)
    there = _run(tmp_path / "there", elsewhere, ELSEWHERE)
    assert here.keys() == there.keys()
    assert [name for name in here if here[name] != there[name]] == []
