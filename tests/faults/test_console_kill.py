"""A console killed once while answers arrive and once while a drive runs; `make soak` does it often."""

import sys

import pytest

from tests.faults.console_kill import kill_while_answering, kill_while_driving

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="finds the process at the wheel in /proc"),
]


def test_answers_that_were_acknowledged_outlive_their_console(tmp_path):
    assert kill_while_answering(tmp_path, 1, seed=1).broken == []


def test_a_drive_outlives_its_console_and_ends(tmp_path):
    assert kill_while_driving(tmp_path, 1, seed=1).broken == []
