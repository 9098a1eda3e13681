import pytest

from steerlab.study.recording import rebuild
from steerlab.study.recording.written import check_written


def test_half_a_recording_is_refused(record, drive, drive_steps, tmp_path):
    with record(rerun=True) as recorder:
        sink = recorder.begin(drive)
        drive_steps(sink, drive)
        sink.finish()
    (file,) = (tmp_path / "study" / "recordings").iterdir()
    check_written(file)
    whole = file.read_bytes()
    for left in (0, 5, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:left])
        with pytest.raises(OSError, match="did not write its end"):
            check_written(file)


def test_recordings_that_rerun_joins_by_half_are_not_kept(tmp_path, monkeypatch):
    half = tmp_path / "rerun"
    half.write_text('#!/bin/sh\nfor last; do :; done\nprintf RRF2 > "$last"\n')  # and ends well
    half.chmod(0o755)
    monkeypatch.setenv("STEERLAB_RERUN", str(half))
    with pytest.raises(OSError, match="did not write its end"):
        rebuild._join([tmp_path / "a", tmp_path / "b"], tmp_path / "all.rrd")
