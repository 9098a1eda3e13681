"""``steerlab correct``: headless by a script, and in a real window by a virtual wheel."""

import shutil
import signal
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from steerlab.app.cli import main
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore
from steerlab.teleop.devices.open import open_device
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.loop import LabelSink, NullClock, run_drive
from tests.teleop.display import Display

ROLLOUTS = load_calibration_set()
SCRIPT = ["--participant", "P01", "--device", "scripted:human:3", "--no-pictures"]
windowed = [
    pytest.mark.display,
    pytest.mark.skipif(shutil.which("Xvfb") is None, reason="not installed: Xvfb"),
]


def attempts(study, *statuses):
    with StudyStore.open(study / "study.db", read_only=True) as store:
        return store.attempts(*statuses)


def test_a_script_corrects_and_what_is_done_is_not_asked_for_again(tmp_path, capsys):
    study = tmp_path / "study"
    assert main(["correct", str(study), *SCRIPT, "--rollouts", "2"]) == 0
    assert main(["correct", str(study), *SCRIPT, "--rollouts", "3"]) == 0
    assert "3 of 3 rollouts corrected" in capsys.readouterr().out
    finished = attempts(study, AttemptStatus.FINISHED)
    assert [one.rollout for one in finished] == [rollout.name for rollout in ROLLOUTS[:3]]
    assert {one.attempt for one in finished} == {0}
    with StudyStore.open(study / "study.db", read_only=True) as store:
        table = store.read_labels()
    device = open_device("scripted:human:3")
    for order, rollout in enumerate(ROLLOUTS[:3]):
        sink = LabelSink()
        run_drive(
            Replay(rollout), device, participant="P01", order=order, clock=NullClock(), sink=sink
        )
        kept = table.filter(np.asarray(table["rollout"]) == rollout.name)["teacher_label"]
        np.testing.assert_array_equal(np.asarray(kept), sink.labels())
    assert sorted(path.suffix for path in (study / "recordings").iterdir()) == [".rrd"] * 3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--device", "steering"], "No device 'steering'"),
        (["--rollouts", "13"], "rollouts is 13; it must be a whole number from 1 to 12"),
        (["--device", "scripted:human:x"], "scripted:KIND:SEED"),
    ],
)
def test_what_cannot_be_is_told(tmp_path, capsys, arguments, says):
    given = ["correct", str(tmp_path / "s"), "--participant", "P01", "--device", "scripted:low:1"]
    assert main([*given, "--no-pictures", *arguments]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("other", ["P01 ", "p01", "P\u00a001", "P 01", "P\uff101"])
def test_a_participant_who_only_looks_new_is_refused(tmp_path, capsys, other):
    study = tmp_path / "study"
    assert main(["correct", str(study), *SCRIPT, "--rollouts", "1"]) == 0
    given = ["correct", str(study), *SCRIPT, "--rollouts", "1", "--participant", other]
    assert main(given) == 2
    said = capsys.readouterr().err
    assert "differ only by blanks, case or Unicode form. Give --participant 'P01' if" in said
    assert {one.participant for one in attempts(study)} == {"P01"}


@pytest.fixture
def display(tmp_path):
    display = Display(tmp_path)
    yield display
    display.close()


def one(folder):
    return ["correct", str(folder / "study"), "--participant", "P01", "--rollouts", "1",
            "--no-pictures"]  # fmt: skip


class TestInAWindow:
    pytestmark = windowed

    def test_a_person_pauses_loses_the_wheel_and_finishes(self, display, tmp_path):
        child = display.run("virtual_person.py", {"pause": 60, "unplug": 140}, *one(tmp_path))
        out, err = child.communicate(timeout=150)
        assert child.returncode == 0, err
        assert "Pause" in out
        assert "Waiting for Logitech G920" in out
        kept = attempts(tmp_path / "study")
        assert [(one.attempt, one.status.value, one.end_reason) for one in kept[:2]] == [
            (0, "abandoned", "paused"),
            (1, "abandoned", "the device was lost"),
        ]
        assert kept[-1].status is AttemptStatus.FINISHED
        with StudyStore.open(tmp_path / "study" / "study.db", read_only=True) as store:
            table = store.read_labels()
            timings = store.timings(kept[-1])
            (session,) = store.sessions().values()
        labels = np.asarray(table["teacher_label"])
        assert len(labels) == ROLLOUTS[0].steps == timings.num_rows
        assert np.asarray(table["label_valid"]).all()
        assert labels.max() > 1.2 > -1.2 > labels.min()  # 0.6 of the way to either side
        np.testing.assert_array_equal(np.asarray(table["robot_wheel"]), ROLLOUTS[0].robot_wheel)
        deadlines = np.asarray(timings["deadline_ns"])
        assert set(np.diff(deadlines)) == {50_000_000}
        assert (session.input_kind, session.device_name) == ("wheel", "Logitech G920")
        assert session.input_latency_ms > 0.5
        assert len(session.profile_sha256) == 64
        assert session.settings["sound"] == "on"
        assert session.settings["window"].startswith("full screen on 0 (")
        assert session.settings["view"] == "driver"

    def test_a_display_that_vanishes_loses_no_step_and_the_session_goes_on_later(
        self, display, tmp_path
    ):
        child = display.run("virtual_person.py", {}, *one(tmp_path))
        for line in child.stdout:
            if "90 frames" in line:
                break
        display.server.send_signal(signal.SIGKILL)
        _, err = child.communicate(timeout=60)
        assert child.returncode == 2
        assert "display has gone away" in err
        (lost,) = attempts(tmp_path / "study")
        assert lost.status is not AttemptStatus.FINISHED
        with closing(sqlite3.connect(tmp_path / "study" / "study.db")) as database:
            assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            (steps,) = database.execute("SELECT count(*) FROM steps").fetchone()
        assert steps >= 25  # 90 frames are 30 steps, and the countdown's frame is one of them
        assert main(["correct", str(tmp_path / "study"), *SCRIPT, "--rollouts", "1"]) == 0
        again = attempts(tmp_path / "study")
        assert [one.attempt for one in again] == [0, 1]
        assert again[0].status is AttemptStatus.ABANDONED
        assert again[1].status is AttemptStatus.FINISHED
