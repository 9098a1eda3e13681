import json
import os
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from steerlab.app import cli, doctor, simulate
from steerlab.app.cli import VERBS, main
from steerlab.sim import calibration_set
from steerlab.sim.engine import camera, gl
from steerlab.sim.errors import NoRenderer

SMALL = ["--teachers", "7", "--new-teachers", "2", "--rollouts", "4"]


def _refused(capsys, *arguments: str) -> str:
    """The one sentence of a refusal: exit code 2 and no traceback."""
    assert main(list(arguments)) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(verb, capsys):
    with pytest.raises(SystemExit) as stop:
        main([verb, "--help"])
    assert stop.value.code == 0
    assert f"Example: steerlab {verb}" in " ".join(capsys.readouterr().out.split())


def test_no_verb_shows_the_help(capsys):
    assert main([]) == 0
    assert "simulate" in capsys.readouterr().out


def test_the_overview_says_what_each_verb_does(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 60
    said = " ".join(" ".join(lines).split())
    for verb in VERBS:
        docstring = cli.verb_function(verb).__doc__ or ""
        assert f"{verb} {docstring.splitlines()[0]}" in said


def test_the_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"steerlab {version('steerlab')}\n"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("simulat", "Did you mean simulate?"),
        ("--seed", "options follow the verb"),
        ("nothing-like-it", "Choose from demo, doctor"),
    ],
)
def test_no_such_verb(given, said, capsys):
    refusal = _refused(capsys, given, "1")
    assert repr(given) in refusal
    assert said in refusal
    assert all(verb in refusal for verb in VERBS)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("study statuss X", "'statuss' is no act of steerlab study. Did you mean status? Choose"),
        ("study", "An act is missing: steerlab study takes one of new, enrol, run"),
        (
            "study verify --jsn X",
            "'--jsn' is no option of steerlab study verify. Did you mean --json",
        ),
        ("study enrol X", "--role (training, test) is missing; steerlab study enrol --help"),
        ("study enrol X --role boss", "role is 'boss'; it must be one of training, test."),
        ("simulate foo --out x", "'foo' is one word too many for steerlab simulate; steerlab sim"),
        ("simulate --outt x", "'--outt' is no option of steerlab simulate. Did you mean --out?"),
        ("simulate --noise wild --out x", "noise is 'wild'; it must be one of paper, low, human"),
        ("fit", "LABELS and --out DIR are missing; steerlab fit --help says more."),
        ("drive --device", "--device STR has no value; steerlab drive --help says more."),
        ("drive --pedals=5", "'5' is one word too many for steerlab drive"),
        ("wheel lst", "act is 'lst'; it must be one of list, calibrate, test. Did you mean list?"),
        ("replay x --no-pictues", "Did you mean --no-pictures?"),
        ("doctor \x1b[31mx", "'\\x1b[31mx' is one word too many"),
    ],
)
def test_words_that_are_no_option_are_refused_in_a_sentence_of_ours(typed, said, capsys):
    refusal = _refused(capsys, *typed.split(" "))
    assert refusal.startswith(f"steerlab: {said}") or said in refusal
    assert refusal.count("\n") == 1
    assert not set("╭│\x1b") & set(refusal)


def test_a_verb_may_be_spelt_as_its_function(tmp_path, capsys):
    (tmp_path / "set.parquet").write_text("x")
    assert "exists" in _refused(capsys, "calibration_set", "--out", str(tmp_path / "set.parquet"))


def test_a_shell_can_complete_every_verb(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--tyro-print-completion", "bash"])
    assert not stop.value.code
    script = capsys.readouterr().out
    assert all(verb in script for verb in VERBS)


def test_a_number_that_is_none_is_said(tmp_path, capsys):
    assert "'x'" in _refused(capsys, "power", "--people", "12", "x", "--out", str(tmp_path / "out"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--noise", "loud"], "human"),
        (["--teachers", "0"], "teachers is 0"),
        (["--new-teachers", "-1"], "new-teachers is -1"),
        (["--rollouts", "13"], "has 12"),
        (["--rollouts", "2"], "rollouts is 2"),
        (["--seed", "-1"], "seed is -1"),
    ],
)
def test_bad_settings_leave_nothing(arguments, said, tmp_path, capsys):
    assert said in _refused(capsys, "simulate", "--out", str(tmp_path / "out"), *arguments)
    assert os.listdir(tmp_path) == []


def test_a_full_folder_is_not_overwritten(tmp_path, capsys):
    (tmp_path / "mine").write_text("x")
    assert "--force" in _refused(capsys, "simulate", "--out", str(tmp_path), *SMALL)
    assert os.listdir(tmp_path) == ["mine"]


def test_an_unwritable_place(capsys):
    assert "Cannot write" in _refused(capsys, "demo", "--out", "/proc/steerlab/out")


def test_no_opengl_is_said_before_anything_runs(tmp_path, caplog, monkeypatch):
    """The study does not need it, only one picture of its report does."""

    def refuse(width, height):
        raise NoRenderer("Cannot draw offscreen. Install a software driver: apt-get install x")

    def look_and_stop(*arguments):
        assert "no picture from the camera. Cannot draw offscreen. Install" in caplog.text
        raise KeyboardInterrupt

    monkeypatch.setattr(camera, "_open_context", refuse)
    monkeypatch.setattr(simulate, "run_population", look_and_stop)
    assert main(["simulate", "--out", str(tmp_path / "out"), *SMALL]) == 130
    assert os.listdir(tmp_path) == []


def test_calibration_set_does_not_overwrite(tmp_path, capsys):
    (tmp_path / "set.parquet").write_text("x")
    said = _refused(capsys, "calibration-set", "--out", str(tmp_path / "set.parquet"))
    assert "exists" in said


def test_a_damaged_installation_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(calibration_set, "CALIBRATION_FILE", "missing.parquet")
    assert "missing.parquet" in _refused(capsys, "simulate", "--out", str(tmp_path / "out"), *SMALL)


def test_an_interrupt_leaves_nothing(tmp_path, capsys, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(simulate, "run_population", interrupt)
    monkeypatch.setattr(simulate, "camera_frame", lambda *a: None)
    assert main(["simulate", "--out", str(tmp_path / "out"), *SMALL]) == 130
    assert "stopped" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


@pytest.mark.render
def test_doctor_tells_how_to_mend(tmp_path, capsys):
    assert main(["doctor", "--json", "--folder", str(tmp_path / "absent")]) == 1
    findings = {one["what"]: one for one in json.loads(capsys.readouterr().out)}
    assert {"Python", "Disk", "OpenGL", "Camera 64 x 64", "Physics"} <= set(findings)
    assert not findings["Disk"]["ok"]
    assert "--folder" in findings["Disk"]["mend"]
    assert findings["OpenGL"]["ok"]
    assert findings["Drawing, training"]["ok"]


def test_doctor_sees_a_process_that_dies(monkeypatch):
    monkeypatch.setattr(doctor, "_DRAW_AND_TRAIN", "import os; os.kill(os.getpid(), 11)")
    found = doctor.examine(Path())[-1]
    assert "not in one process" in found.found
    assert "it ended with -11" in found.found
    assert "make TORCH=cpu" in found.mend


def test_doctor_without_opengl(capsys, monkeypatch):
    def refuse(width, height):
        raise NoRenderer("Cannot draw offscreen.")

    monkeypatch.setattr(camera, "_open_context", refuse)
    assert main(["doctor"]) == 1
    assert "mend: sudo apt-get install libegl1" in capsys.readouterr().out


def test_the_module_runs_as_a_program():
    done = subprocess.run(
        [sys.executable, "-m", cli.__name__, "simulate"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "--out" in done.stderr


def test_a_reader_that_has_seen_enough_is_no_error():
    """As in ``steerlab --help | head -1``."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "steerlab.app.cli", "--help"]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writing)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.parametrize("columns", ["1", "10", "100000000"])
@pytest.mark.parametrize("arguments", [["--help"], ["simulate", "--help"], ["simulate", "--nope"]])
def test_no_terminal_is_too_narrow_or_too_wide(arguments, columns):
    done = subprocess.run(
        [sys.executable, "-m", cli.__name__, *arguments],
        env=os.environ | {"COLUMNS": columns}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    said = done.stdout + done.stderr
    assert "simulate" in said
    assert max(map(len, said.splitlines())) <= 1000


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such terminal there")
@pytest.mark.parametrize("arguments", [["--help"], ["simulate", "--help"], ["study", "new", "é"]])
def test_a_terminal_of_another_encoding_shows_what_it_can(arguments, tmp_path):
    terminal, inside = os.openpty()
    command = [sys.executable, "-m", cli.__name__, *arguments]
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.Popen(command, stdout=inside, stderr=inside, env=environment, cwd=tmp_path)
    os.close(inside)
    said = b""
    try:
        while piece := os.read(terminal, 4096):
            said += piece
    except OSError:  # Linux says so when the other end is closed
        pass
    os.close(terminal)
    assert done.wait(60) == 0, said
    assert b"steerlab" in said
    assert said.isascii()


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX shell")
@pytest.mark.parametrize("closed", ["1>&-", "2>&-", "0<&-"])
def test_a_stream_that_was_closed_is_no_error(closed, tmp_path):
    command = f'"{sys.executable}" -m {cli.__name__} study new made {closed}'
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "made" / "study.db").is_file()


def test_doctor_says_what_is_wrong_with_the_back_end_that_was_asked_for(capsys, monkeypatch):
    monkeypatch.setattr(
        doctor, "_training", lambda: doctor.CheckResult(what="x", found="", ok=True)
    )
    monkeypatch.setattr(gl, "works", lambda backend: False)
    for name, value in {"MUJOCO_GL": "glut", "STEERLAB_GL": "", "STEERLAB_GL_WHY_NOT": ""}.items():
        monkeypatch.setenv(name, value)
    assert main(["doctor", "--json"]) == 1
    findings = {one["what"]: one for one in json.loads(capsys.readouterr().out)}
    assert not findings["OpenGL"]["ok"]
    assert "MUJOCO_GL is 'glut'" in findings["OpenGL"]["found"]
    assert "Unset MUJOCO_GL" in findings["OpenGL"]["mend"]


def test_one_damaged_profile_does_not_hide_the_wheels(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "steerlab" / "wheels"
    folder.mkdir(parents=True)
    (folder / "mine.toml").write_text("format = [")
    assert main(["wheel", "list"]) == 1
    printed = capsys.readouterr()
    assert "No joystick" in printed.out
    assert "mine.toml" in printed.err
    assert "Mend or remove the file" in printed.err
