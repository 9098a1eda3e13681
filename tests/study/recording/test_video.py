"""An attempt as an .mp4: what it holds, that it is whole or not there, and that an erasure finds it."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from steerlab.app.cli import main
from steerlab.sim.errors import MissingPackage
from steerlab.study.derived import ErasedMeanwhile, derived_files, left_of
from steerlab.study.recording import replay as replay_module
from steerlab.study.recording.rebuild import open_study
from steerlab.study.recording.replay import ReplayConfig, replay
from steerlab.study.recording.video import STRIP_PX, VIDEO_PX, make_video, write_video
from steerlab.study.recording.viewer import RecordingUnavailable
from steerlab.study.store.people import erase_rows

av = pytest.importorskip("av", reason="the extra video is not installed")


class Green:
    """A view that draws the step in its brightness."""

    def __init__(self, world):
        self.drawn = 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def frame(self, pose, road_wheel_rad=0.0):
        self.drawn += 1
        picture = np.zeros((VIDEO_PX[1], VIDEO_PX[0], 3), np.uint8)
        picture[..., 1] = 15 * self.drawn
        return picture


class Noise(Green):
    """A view whose pictures take more room than the files that SQLite needs to read the study."""

    def frame(self, pose, road_wheel_rad=0.0):
        size = (VIDEO_PX[1], VIDEO_PX[0], 3)
        return np.random.default_rng(0).integers(0, 255, size, dtype=np.uint8)


@pytest.fixture
def study(record, drive, drive_steps):
    with record() as recorder:
        drive_steps(sink := recorder.begin(drive), drive, last=5)
        sink.abandon("stopped")
        drive_steps(sink := recorder.begin(drive), drive)
        sink.finish()
    return recorder.folder


def decoded(file):
    with av.open(str(file)) as container:
        (stream,) = container.streams.video
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        codec, form = stream.codec_context.name, stream.codec_context.pix_fmt
        seconds = float(stream.duration * stream.time_base)
        return frames, seconds, (codec, form), dict(container.metadata)


def test_it_holds_a_frame_for_each_step(study, tmp_path):
    told = []
    attempt = make_video(
        study,
        tmp_path / "one.mp4",
        open_view=Green,
        progress=lambda what, share: told.append(share),
    )
    assert attempt.attempt == 1
    frames, seconds, form, about = decoded(tmp_path / "one.mp4")
    assert len(frames) == 12
    assert seconds == pytest.approx(12 / 20.0)
    assert frames[0].shape == (540, 960, 3)
    assert form == ("h264", "yuv420p")
    green = [frame[100:300, 100:300, 1].mean() for frame in frames]
    assert np.diff(green) == pytest.approx(np.full(11, 15.0), abs=4.0)  # in order, none twice
    assert about["title"] == f"P01 · {attempt.rollout} · attempt 1"
    assert (told[0], told[-1], len(told)) == (0.0, 1.0, 13)
    index = (tmp_path / "one.mp4").read_bytes()
    assert index.index(b"moov") < index.index(b"mdat")  # a browser can begin before it has all


def test_the_strip_shows_both_wheels(study, tmp_path):
    """The person's yellow bar grows to the left, the robot's blue one is as long as its wheel."""
    make_video(study, tmp_path / "one.mp4", open_view=Green)
    frames, *_ = decoded(tmp_path / "one.mp4")
    with open_study(study) as store:
        steps = store.attempt_data(store.attempts()[-1]).steps
    widths = []
    for frame in frames:
        strip = frame[-STRIP_PX:].astype(int)
        row = strip[18]
        widths.append(int(((row[..., 0] > 170) & (row[..., 1] > 170) & (row[..., 2] < 130)).sum()))
    labels = [step.teacher_label for step in steps]
    assert labels[1] is None
    assert widths[1] < 30  # no bar, only a word
    assert [widths[k] for k in (4, 8, 11)] == sorted(widths[k] for k in (4, 8, 11))
    assert widths[11] - widths[4] == pytest.approx(0.7 / 2.5 * 210, abs=6)


def test_other_attempts_can_be_chosen(study, tmp_path):
    config = ReplayConfig(video=tmp_path / "first.MP4", attempt=0, participant="P01")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay_module, "view_of", lambda world, size_px: Green(world))
        (shown,) = replay(study, config, show=lambda files: pytest.fail("shown"))
    assert shown.attempt == 0
    assert len(decoded(tmp_path / "first.MP4")[0]) == 5


def test_what_cannot_be_made_is_told(study, tmp_path, monkeypatch):
    with pytest.raises(RecordingUnavailable, match=r"choose from \['P01'\]"):
        make_video(study, tmp_path / "a.mp4", participant="P07", open_view=Green)
    with pytest.raises(RecordingUnavailable, match=r"does not end in \.mp4"):
        replay(study, ReplayConfig(video=tmp_path / "a.avi"))
    with pytest.raises(RecordingUnavailable, match=r"There is no study\.db in"):
        replay(tmp_path, ReplayConfig(video=tmp_path / "a.mp4"))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingPackage, match=r"run pip install 'steerlab\[video\]'\.$"):
        make_video(study, tmp_path / "a.mp4", open_view=Green)
    assert main(["replay", str(study), "--video", str(tmp_path / "a.mp4")]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["study"]


def test_a_picture_that_cannot_be_drawn_leaves_nothing(study, tmp_path):
    class Broken(Green):
        def frame(self, pose, road_wheel_rad=0.0):
            if self.drawn == 7:
                raise RuntimeError("no more")
            return super().frame(pose, road_wheel_rad)

    (tmp_path / "one.mp4").write_bytes(b"before")
    with pytest.raises(RuntimeError, match="no more"):
        make_video(study, tmp_path / "one.mp4", open_view=Broken)
    assert (tmp_path / "one.mp4").read_bytes() == b"before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.mp4", "study"]


FULL = """
import resource, signal, sys
from pathlib import Path
from steerlab.sim.errors import SteerlabError
from steerlab.study.recording.video import make_video
from tests.study.recording.test_video import Noise
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
try:
    make_video(Path(sys.argv[1]), Path(sys.argv[2]), open_view=Noise)
except SteerlabError as error:
    sys.exit(str(error))
"""


@pytest.mark.parametrize("short", [4, 900])
def test_a_disk_that_takes_no_more_is_told(study, tmp_path, short):
    """Also where only the last bytes do not fit."""
    pytest.importorskip("resource")
    make_video(study, tmp_path / "one.mp4", open_view=Noise)
    size = (tmp_path / "one.mp4").stat().st_size
    (tmp_path / "one.mp4").unlink()
    command = [sys.executable, "-B", "-c", FULL, study, tmp_path / "one.mp4", size - short]
    done = subprocess.run([*map(str, command)], capture_output=True, encoding="utf-8", check=False)
    assert "Cannot write" in done.stderr
    assert "ulimit -f" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["study"]


def test_it_is_found_by_content_wherever_it_lies(study, tmp_path):
    make_video(study, study / "talk" / "figure.mp4", open_view=Green)
    file = study / "talk" / "figure.mp4"
    assert left_of(study, "P01") == [file]
    assert left_of(study, "P0") == []
    assert derived_files(study, ("study.db", "run.lock", "run.pid")) == [file]
    with av.open(str(study / "own.mp4"), "w") as container:  # somebody's own
        stream = container.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        container.mux(stream.encode(av.VideoFrame.from_ndarray(np.zeros((64, 64, 3), np.uint8))))
        container.mux(stream.encode())
    (study / "broken.mp4").write_bytes(file.read_bytes()[:40])
    (study / "strange.mp4").write_bytes(b"\0\0\0\1ftyp" + b"\xff" * 40)
    assert left_of(study, "P01") == [file]
    assert derived_files(study, ("study.db", "run.lock", "run.pid")) == [file]


def test_it_is_not_kept_if_somebody_is_erased_meanwhile(study, tmp_path):
    def meanwhile(what: str, share: float) -> None:
        if share == 0.0:
            with open_study(study) as reader:
                path = reader.path
            from steerlab.study.store.store import StudyStore

            with StudyStore.open(path) as store:
                erase_rows(store.connection, "P01")

    with pytest.raises(ErasedMeanwhile):
        make_video(study, tmp_path / "one.mp4", open_view=Green, progress=meanwhile)
    assert not (tmp_path / "one.mp4").exists()


def test_a_rate_that_is_no_whole_number(study, tmp_path):
    with open_study(study) as store:
        data = store.attempt_data(store.attempts()[-1])
    data = replace(data, rollout=replace(data.rollout, control_hz=12.5))
    write_video(data, tmp_path / "one.mp4", open_view=Green)
    frames, seconds, *_ = decoded(tmp_path / "one.mp4")
    assert len(frames) == 12
    assert seconds == pytest.approx(12 / 12.5)


@pytest.mark.render
def test_it_is_drawn_by_the_car_s_camera(study, tmp_path):
    replay(study, ReplayConfig(video=tmp_path / "one.mp4"))
    frames, *_ = decoded(tmp_path / "one.mp4")
    assert frames[0].shape == (540, 960, 3)
    assert frames[0][:-STRIP_PX].std() > 20.0
