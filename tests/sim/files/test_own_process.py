"""Programs that Ctrl+C in the terminal is not meant for."""

import os
import subprocess
import sys

from steerlab.sim.files import own_process
from steerlab.sim.files.own_process import apart_from_terminal

WHERE = "import os; print(os.getsid(0))"


def test_it_is_in_no_session_of_ours():
    command = [sys.executable, "-c", WHERE]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, **apart_from_terminal())
    said, _ = process.communicate(timeout=20)
    assert int(said) == process.pid != os.getsid(0)


def test_windows_is_asked_for_a_group(monkeypatch):
    monkeypatch.setattr(own_process.subprocess, "CREATE_NEW_PROCESS_GROUP", 512, raising=False)
    assert apart_from_terminal() == {"creationflags": 512}
