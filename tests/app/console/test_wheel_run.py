"""What a process of its own writes can be read while it goes on."""

import subprocess
import sys
import tempfile

import pytest

from steerlab.app.console import wheel_run
from steerlab.app.console.wheel_run import RunOutput, WheelRuns
from steerlab.study.contract import StudyError


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder for temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture
def output():
    made = RunOutput()
    yield made
    made.close()


def test_reading_does_not_move_the_writer(output):
    for text in (b"one ", b"two ", b"three"):
        output.sink.write(text)
        output.sink.flush()
        output.tail(4)
    assert output.tail(100) == b"one two three"
    assert output.tail(5) == b"three"


def test_a_process_writes_on_when_nobody_reads_any_more(output):
    code = "import sys; print(sys.stdin.readline(), flush=True)"
    command = [sys.executable, "-c", code]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=output.sink)
    output.handed_over()
    output.close()
    process.communicate(b"hello\n", timeout=20)
    assert process.returncode == 0


def test_nothing_is_left_in_the_folder_for_temporary_files(output, folder):
    assert list(folder.iterdir()) == []
    output.close()
    assert list(folder.iterdir()) == []


def test_a_system_that_keeps_the_name_of_an_open_file_loses_it_at_the_end(folder, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(wheel_run.Path, "unlink", _refuse)  # as on Windows, while it is open
        output = RunOutput()
    assert len(list(folder.iterdir())) == 1
    output.close()
    assert list(folder.iterdir()) == []


def _refuse(*_: object, **__: object) -> None:
    raise PermissionError(13, "in use by another process")


def test_an_erasure_that_could_not_be_started_stays_due(tmp_path):
    runs = WheelRuns(tmp_path, command=("no-such-program",))
    runs.erase_later("P001")
    with pytest.raises(StudyError, match="cannot be started"):
        runs.erase_waiting()
    assert runs.to_erase == ("P001",)
    runs.close()
