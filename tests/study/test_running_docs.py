"""What docs/running-a-study.md tells an experimenter to type does what it says."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from steerlab.app.cli import main

PAGE = (Path(__file__).parents[2] / "docs" / "running-a-study.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
_LOOP = re.compile(r"for seed in (.+); do (.+); done")


def _lines():
    """What is typed, line by line; of a loop the first round, which is enough people here."""
    for language, block in BLOCKS:
        for line in () if language else block.splitlines():
            loop = _LOOP.fullmatch(line)
            yield loop[2].replace("$seed", loop[1].split()[0]) if loop else line


LINES = list(_lines())
EXITS = {  # all others: 0
    "steerlab study redo": 2,  # T001 has not calibrated
    "steerlab study train": 2,  # nobody has finished
    "steerlab study verify my-study --expect-head": 1,  # of another study
}
SAID = {
    "steerlab study run my-study": "T001 is at consent",
    "steerlab study amend": r"Version 2 .* is frozen\.\s+Enrolled before and not begun: P001",
    "steerlab study verify tryout": "note P00|ok   Audit",
    "steerlab study verify my-study --expect-head": "no entry has the hash",
    "steerlab study withdraw my-study P003 --erase": "their data are erased",
    "steerlab study run tryout --teacher scripted:human:9": "P001 has nothing left to do",
    "steerlab study run tryout": "T00. has nothing left to do",
}


def _of(line: str, table: dict):
    return next((value for start, value in table.items() if line.startswith(start)), None)


@pytest.mark.slow
def test_the_commands_do_what_the_page_says(tmp_path, monkeypatch, capsys, change, shorten):
    monkeypatch.chdir(tmp_path)
    done = []
    for line in LINES:
        command, *words = shlex.split(line)
        if command == "cp":
            shorten(Path("my-study"))
            shutil.copy(words[0], words[1])
        if command != "steerlab" or words[0] not in ("study", "console"):
            continue
        if words[:2] == ["study", "amend"]:
            for _ in range(3):
                assert main(["study", "enrol", "my-study", "--role", "test"]) == 0
            change(
                Path("my-study"), ("TO BE REPLACED by", "This is"), ("version = 1", "version = 2")
            )
        if words[0] == "console":  # would serve until somebody stops it: refuses this folder
            words[1] = "nowhere"
        found = main(words)
        said = capsys.readouterr()
        if words[0] == "console":
            assert (found, "There is no study in nowhere" in said.err) == (2, True), line
            continue
        assert found == (_of(line, EXITS) or 0), (line, said)
        assert re.search(_of(line, SAID) or "", said.out + said.err), (line, said)
        done.append(words[1])
    acts = {
        "new",
        "enrol",
        "run",
        "resume",
        "status",
        "redo",
        "note",
        "amend",
        "withdraw",
        "backup",
    }
    assert {*acts, "verify", "train"} == set(done)


def test_the_python_on_the_page_runs(tmp_path, monkeypatch, capsys, folder):
    (code,) = [block for language, block in BLOCKS if language == "python"]
    shutil.copytree(folder, tmp_path / "my-study")
    monkeypatch.chdir(tmp_path)
    assert main(["study", "enrol", "my-study", "--role", "test"]) == 0
    capsys.readouterr()
    exec(compile(code, "running-a-study.md", "exec"), {})
    frozen_utc, digest, before, alpha = capsys.readouterr().out.split()
    assert (len(digest), before, alpha) == (64, "0", "0.05")
    assert frozen_utc.endswith("Z")
