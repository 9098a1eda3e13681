"""Drawing and training in one process, with Triton installed, as PyTorch's CUDA build has it.

The wrong order ends in a segmentation fault, so everything here runs in fresh processes.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from steerlab.app.cli import VERBS
from tests.teleop.display import Display

PROGRAM = Path(__file__).with_name("draw_and_train.py")
EXAMPLE = Path(__file__).parents[1] / "docs" / "example-labels.csv"
ORDERS = ("draw,train,{},train,draw", "train,draw,{},draw,train")
pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(
        find_spec("triton") is None, reason="not installed: triton, which Linux alone has"
    ),
]
SMALL = ("--teachers", "7", "--new-teachers", "2", "--rollouts", "4", "--ladder", "quick")
COMMANDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "demo": ("verb", ("--out", "demo")),
    "doctor": ("verb", ()),
    "wheel": ("verb", ("list",)),
    "drive": ("interrupt:6", ("--device", "keyboard", "--no-pedals", "--windowed", "--no-sound")),
    "correct": (
        "verb",
        ("corrected", "--participant", "P01", "--rollouts", "1", "--device", "scripted:low:1"),
    ),
    "replay": ("verb", ("{study}", "--save", "replay.rrd", "--rollout", "calibration-00")),
    "study": ("verb", ("run", "{study}", "--teacher", "scripted:human:4")),
    "console": ("interrupt:4", ("{study}", "--port", "0")),
    "simulate": ("verb", ("--out", "simulated", *SMALL)),
    "fit": ("verb", (str(EXAMPLE), "--out", "fitted", "--ladder", "quick")),
    "synthetic": ("verb", ("--out", "synthetic", "--people", "8", "--new-people", "3")),
    "teach": (
        "verb",
        (
            "--out",
            "taught",
            "--learners",
            "bc",
            "--teachers",
            "1",
            "--rounds",
            "1",
            "--learner-seeds",
            "1",
            "--training-steps",
            "5",
        ),
    ),
    "analyze": ("verb", ("{study}", "--out", "analysed")),
    "export": ("verb", ("{study}", "--format", "csv", "--out", "exported")),
    "power": (
        "verb",
        (
            "--out",
            "power",
            "--people",
            "12",
            "--studies",
            "100",
            "--plant",
            "mini_ipip_5.neuroticism:gain:0.4",
        ),
    ),
    "calibration-set": ("verb", ("--out", "set.parquet")),
}


def _run(*arguments: object, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=300,
    )


@pytest.fixture(scope="module")
def display(tmp_path_factory):
    if shutil.which("Xvfb") is None:
        pytest.skip("not installed: Xvfb")
    display = Display(tmp_path_factory.mktemp("display"))
    yield display.environment["DISPLAY"]
    display.close()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "study"
    for act in (("new", folder), ("run", folder, "--teacher", "scripted:human:3")):
        done = _run("-m", "steerlab.app.cli", "study", *act, folder=folder.parent)
        assert done.returncode == 0, done.stderr
    return folder


def test_without_care_the_process_dies(tmp_path):
    """What the others guard against, where there is such a driver: Debian 12 has, Debian 13 not."""
    code = (
        "import mujoco.egl; context = mujoco.egl.GLContext(8, 8); context.make_current(); "
        "import triton"
    )
    ended = _run("-c", code, folder=tmp_path, MUJOCO_GL="egl").returncode
    if ended == 0:
        pytest.skip("the OpenGL driver here keeps its LLVM to itself")
    assert ended == -11


def test_someone_else_may_have_drawn_first(tmp_path):
    """Then Triton is kept out, and PyTorch trains without it."""
    code = (
        "import mujoco.egl, runpy, sys; context = mujoco.egl.GLContext(8, 8); "
        "context.make_current(); sys.argv = ['x', 'draw,train,draw', '--']; "
        f"runpy.run_path({str(PROGRAM)!r}, run_name='__main__')"
    )
    done = _run("-c", code, folder=tmp_path, MUJOCO_GL="egl")
    assert done.returncode == 0, done.stderr


def test_every_verb_is_tried():
    assert set(COMMANDS) == set(VERBS)


@pytest.mark.slow
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_draws_and_trains_in_any_order(verb, order, study, display, tmp_path):
    how, arguments = COMMANDS[verb]
    filled = [argument.format(study=study) for argument in arguments]
    steps = order.format(how)
    done = _run(PROGRAM, steps, "--", verb, *filled, folder=tmp_path, DISPLAY=display)
    if verb == "doctor":  # it may find this machine slow, and says so with 1
        assert "ok   Drawing, training  in one process, with Triton" in done.stdout
        assert done.returncode in (0, 1)
    else:
        assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
