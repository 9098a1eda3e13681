"""macOS and Windows by construction: what steerlab does where the things of POSIX are missing.

None of this is the real system (docs/platforms.md): ``without_posix.py`` takes from steerlab's code
what Windows lacks, and everything is done in a fresh process without it, and without OpenGL.
"""

import ast
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

TOP = Path(__file__).parents[1]
PROGRAM = Path(__file__).with_name("without_posix.py")


def _without_posix() -> ModuleType:
    spec = importlib.util.spec_from_file_location(PROGRAM.stem, PROGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


HIDDEN = _without_posix()
FILES = sorted(path for layer in HIDDEN.LAYERS for path in (TOP / layer).rglob("*.py"))
GUARDED = {
    ("app/console/connections.py", "resource"),
    ("app/console/priority.py", "os.nice"),
    ("sim/files/whole_file.py", "os.O_DIRECTORY"),
    ("sim/files/machine.py", "resource"),
    ("sim/files/machine.py", "os.sched_getaffinity"),
    ("sim/files/machine.py", "os.getloadavg"),
    ("sim/engine/camera.py", "os.register_at_fork"),
}
"""Names that not every system has, and the only places that use them: where they are asked for."""


def _run(*arguments: object, folder: Path) -> str:
    """What the program says on stdout; it must end well, and without a traceback."""
    done = subprocess.run(
        [sys.executable, "-X", "warn_default_encoding", PROGRAM, *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "MUJOCO_GL": "disabled"},
        capture_output=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def test_every_module_can_be_imported(tmp_path):
    wanted = len(FILES) - (sys.version_info >= (3, 13))  # without dm_control, drive_to_ball
    assert f"imported {wanted} of {len(FILES)} modules" in _run("import", folder=tmp_path)


REFUSED = (
    "import fcntl",
    "import os; os.sched_getaffinity(0)",
    "import os; os.open('/', os.O_RDONLY)",
    "from os import geteuid",
    "import signal; signal.SIGKILL",
    "from pathlib import Path; Path('/proc/cpuinfo').read_text(encoding='utf-8')",
    "from pathlib import Path; Path(__file__).read_text()",
    "open(__file__)",
)
ALLOWED = (
    "import os; os.close(os.open(__file__, os.O_RDONLY))",
    "import os, signal; os.getpid(), signal.SIGINT",
    "from pathlib import Path; Path(__file__).read_text(encoding='utf-8')",
    "import subprocess, sys; subprocess.run([sys.executable, '-c', ''], check=True)",
)


def test_what_is_said_to_be_hidden_is(tmp_path):
    code = "import sys\nimport without_posix\nwithout_posix.hide()\nfor line in sys.argv[1:]:\n"
    code += "    space = {'__name__': 'steerlab.x', '__file__': without_posix.__file__}\n"
    code += "    try:\n        exec(line, space)\n"
    code += (
        "    except (ImportError, AttributeError, OSError, EncodingWarning):\n        continue\n"
    )
    code += "    print(line)\n"
    done = subprocess.run(
        [sys.executable, "-X", "warn_default_encoding", "-c", code, *REFUSED, *ALLOWED],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(PROGRAM.parent)},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    assert done.stdout.splitlines() == list(ALLOWED)


@pytest.mark.slow
def test_labels_are_fitted(tmp_path):
    labels = TOP / "docs" / "example-labels.csv"
    said = _run("fit", labels, "--out", "out", "--ladder", "quick", folder=tmp_path)
    assert "MIND MELD" in said
    assert (tmp_path / "out" / "report" / "index.html").stat().st_size > 100_000


@pytest.mark.slow
def test_a_study_is_simulated_without_pictures_and_says_so(tmp_path):
    small = ("--teachers", 3, "--new-teachers", 2, "--rollouts", 4, "--ladder", "quick")
    said = _run("simulate", "--out", "out", *small, folder=tmp_path)
    assert "MIND MELD" in said
    page = (tmp_path / "out" / "report" / "index.html").read_text(encoding="utf-8")
    assert "The camera’s frame is left out" in page


PROTOCOL = (
    ("rollouts = 12 ", 'rollouts = ["calibration-05", "calibration-07"] '),
    ("minimum_people = 8 ", "minimum_people = 2 "),
    ('preset = "lab"', 'preset = "lab"\nepochs = 2'),
    ("balls = 5", "balls = 1"),
)


@pytest.mark.slow
def test_a_scripted_study_from_its_protocol_to_a_withdrawal(tmp_path):
    """All that needs no picture: those who are taught by what a camera sees are left out."""
    _run("study", "new", "s", folder=tmp_path)
    protocol = tmp_path / "s" / "study.toml"
    text = protocol.read_text(encoding="utf-8")
    for before, after in PROTOCOL:
        assert before in text
        text = text.replace(before, after, 1)
    protocol.write_text(text, encoding="utf-8")
    said = _run(
        *("study", "run", "s", "--teacher", "scripted:human:1", "::"),
        *("study", "run", "s", "--teacher", "scripted:human:2", "::"),
        *("study", "train", "s", "::"),
        *("study", "status", "s", "::"),
        *("study", "verify", "s", "::"),
        *("replay", "s", "--no-pictures", "--save", "all.rrd", "::"),
        *("study", "withdraw", "s", "T002", "--erase", "::"),
        *("study", "verify", "s"),
        folder=tmp_path,
    )
    assert "T001  training  finished" in said
    assert "T002 has nothing left to do." in said
    assert "of 2 people, as frozen" in said
    assert "BAD" not in said
    assert (tmp_path / "all.rrd").stat().st_size > 10_000
    assert not list((tmp_path / "s").rglob("*T002*"))


def test_what_only_posix_has_is_used_in_guarded_places_alone():
    used = {(place, name) for place, node in _all_code() for name in _posix_names(node)}
    assert used == GUARDED


def test_an_unguarded_name_would_be_seen():
    code = "import fcntl\nfrom pwd import getpwnam\nfrom os import fork\nos.pread(3, 1, 0)\nos.fsync(3)"
    found = [name for node in ast.walk(ast.parse(code)) for name in _posix_names(node)]
    assert sorted(found) == ["fcntl", "os.fork", "os.pread", "pwd"]


def _all_code() -> Iterator[tuple[str, ast.AST]]:
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            yield path.relative_to(TOP).as_posix(), node


def _posix_names(node: ast.AST) -> list[str]:
    names = {module.__name__: hidden for module, hidden in HIDDEN.NAMES.items()}
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names if alias.name in HIDDEN.MODULES]
    if isinstance(node, ast.ImportFrom):
        if node.module in HIDDEN.MODULES:
            return [node.module]
        hidden = names.get(node.module or "", ())
        return [f"{node.module}.{alias.name}" for alias in node.names if alias.name in hidden]
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        module = node.value.id
        return [f"{module}.{node.attr}"] if node.attr in names.get(module, ()) else []
    return []


def test_text_is_never_in_the_encoding_of_the_system():
    """UTF-8 must be said: on Windows the default is another."""
    unsaid = [
        f"{place}:{node.lineno} {ast.unparse(node)}"
        for place, node in _all_code()
        if isinstance(node, ast.Call) and _leaves_encoding_out(node)
    ]
    assert unsaid == []


@pytest.mark.parametrize(
    ("code", "leaves_out"),
    [
        ("path.read_text()", True),
        ("path.read_text('utf-8')", False),
        ("path.write_text(text)", True),
        ("path.write_text(text, encoding='utf-8')", False),
        ("path.open()", True),
        ("path.open('w')", True),
        ("path.open('rb')", False),
        ("open(path, 'a+')", True),
        ("open(path, mode='wb')", False),
        ("os.open(path, flags)", False),
        ("subprocess.run(command, text=True)", True),
        ("subprocess.run(command, text=True, encoding='utf-8')", False),
        ("StudyStore.open(path)", False),
    ],
)
def test_an_encoding_left_out_is_seen(code, leaves_out):
    assert _leaves_encoding_out(ast.parse(code).body[0].value) is leaves_out


def _leaves_encoding_out(node: ast.Call) -> bool:
    given = {keyword.arg for keyword in node.keywords}
    if "encoding" in given:
        return False
    if isinstance(node.func, ast.Attribute):
        name, of = node.func.attr, ast.unparse(node.func.value)
    else:
        name, of = ast.unparse(node.func), ""
    if name == "read_text":
        return not node.args
    if name == "write_text":
        return len(node.args) < 2
    if name == "open" and not of:
        return _is_text_mode(node, 1)
    if name == "open" and _is_a_path(of):
        return _is_text_mode(node, 0)
    return of == "subprocess" and bool(given & {"text", "universal_newlines"})


def _is_a_path(name: str) -> bool:
    """``open`` is also a method of stores, joysticks and pictures."""
    return "path" in name.lower() or "file" in name.lower() or "/" in name


def _is_text_mode(node: ast.Call, position: int) -> bool:
    modes = [keyword.value for keyword in node.keywords if keyword.arg == "mode"]
    modes += node.args[position : position + 1]
    return not any("b" in ast.unparse(mode) for mode in modes)
