"""``steerlab drive`` of what no person holds: a script ends by itself, a trace is refused."""

import pytest

from steerlab.app.cli import main
from steerlab.study import calibration_session


@pytest.fixture(autouse=True)
def no_window(monkeypatch):
    def opened(*_, **__):
        raise AssertionError("a window was opened for a script")

    monkeypatch.setattr(calibration_session, "practise", opened)


def test_a_script_reaches_its_balls_and_the_drive_ends(capsys):
    assert main(["drive", "--device", "scripted:human:3", "--balls", "1", "--no-pedals"]) == 0
    assert capsys.readouterr().out.startswith("1 of 1 balls reached, ")


@pytest.mark.parametrize(
    ("device", "said"),
    [
        ("trace:drive.csv", "trace:drive.csv has no practice drive in it"),
        ("scripted:humn:3", "No scripted teacher 'scripted:humn:3'"),
    ],
)
def test_what_cannot_practise_is_refused(device, said, capsys):
    assert main(["drive", "--device", device]) == 2
    assert said in capsys.readouterr().err
