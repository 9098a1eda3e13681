"""From a wheel that nobody knows to labels: calibrate, practise, correct, each in its window."""

import shutil

import numpy as np
import pytest

from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore
from steerlab.teleop.devices.profile_folder import profile_from_toml
from tests.teleop.display import Display

pytestmark = [
    pytest.mark.slow,
    pytest.mark.display,
    pytest.mark.skipif(shutil.which("Xvfb") is None, reason="not installed: Xvfb"),
]


@pytest.fixture(scope="module")
def display(tmp_path_factory):
    display = Display(tmp_path_factory.mktemp("sitting"))
    yield display
    display.close()


def drive(display, *arguments):
    child = display.run("virtual_driver.py", {}, *arguments)
    out, err = child.communicate(timeout=100)
    assert child.returncode == 0, out + err
    return out


@pytest.fixture(scope="module")
def calibrated(display):
    return drive(display, "wheel", "calibrate")


def test_the_wizard_finds_out_what_kind_of_wheel_it_is(display, calibrated):
    assert "The wheel is calibrated" in calibrated
    (file,) = (display.folder / "config").rglob("*.toml")
    profile = profile_from_toml(file.read_text(), file.name)
    assert profile.calibrated
    steering = profile.steering
    assert (steering.axis, steering.sign) == (0, -1)
    assert (steering.minimum, steering.maximum) == pytest.approx((-0.9, 0.9), abs=1e-3)
    assert (profile.throttle.rest, profile.throttle.pressed) == (1.0, -1.0)
    assert {int(number) for number in profile.buttons.values()} == {9, 8, 4}


def test_a_practice_drive_to_a_ball_with_pedals(display, calibrated):
    said = drive(display, "drive", "--balls", "1", "--seed", "7")
    assert "Press each pedal once" in said  # none had moved since the wheel was opened
    assert "Ball 1 of 1" in said
    assert "1 of 1 balls reached, 0 blocks hit" in said


def test_labels_of_the_wheel_as_it_was_calibrated(display, calibrated):
    study = display.folder / "study"
    drive(
        display, "correct", str(study), "--participant", "P01", "--rollouts", "1", "--no-pictures"
    )
    with StudyStore.open(study / "study.db", read_only=True) as store:
        (attempt,) = store.attempts(AttemptStatus.FINISHED)
        labels = np.asarray(store.steps(attempt)["teacher_label"])
        (session,) = store.sessions().values()
    assert np.isfinite(labels).all()
    assert labels.std() > 0.1
    assert len(session.profile_sha256) == 64
