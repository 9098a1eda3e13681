"""``steerlab replay``: saved, drawn and shown."""

from dataclasses import replace

import pytest
from rerun.chunk import RrdReader

from steerlab.sim.errors import NoRenderer
from steerlab.study.recording import replay as replay_module
from steerlab.study.recording.replay import ReplayConfig, oracle_path, replay
from steerlab.study.recording.viewer import RecordingUnavailable

BARE = ReplayConfig(pictures=False)


@pytest.fixture
def study(record, drive, drive_steps):
    with record() as recorder:
        for _ in range(2):
            drive_steps(sink := recorder.begin(drive), drive)
            sink.finish()
    return recorder.folder


def test_it_is_shown_and_then_gone(study):
    shown = []

    def show(files):
        shown.extend(
            (file, [r.recording_id for r in RrdReader(file).recordings()]) for file in files
        )

    attempts = replay(study, BARE, show=show)
    ((file, ids),) = shown
    assert ids == [f"P01/{a.rollout}/{a.attempt}" for a in attempts]
    assert len(ids) == 2
    assert not file.exists()


def test_it_is_saved_and_not_shown(study, tmp_path):
    def show(files):
        pytest.fail("shown although it was to be saved")

    config = replace(BARE, save=tmp_path / "out.rrd", attempt=1)
    (attempt,) = replay(study, config, show=show)
    assert attempt.attempt == 1
    assert [r.recording_id for r in RrdReader(tmp_path / "out.rrd").recordings()] == [
        f"P01/{attempt.rollout}/1"
    ]


def test_a_picture_is_made_of_the_last_attempt_alone(study, tmp_path, monkeypatch):
    drawn = []

    def draw(file, png, *, at_s):
        drawn.extend(r.recording_id for r in RrdReader(file).recordings())

    monkeypatch.setattr(replay_module, "screenshot", draw)
    (attempt,) = replay(study, replace(BARE, screenshot=tmp_path / "last.png"))
    assert attempt.attempt == 1
    assert drawn == [f"P01/{attempt.rollout}/1"]


def test_a_saved_recording_is_shown_as_it_is(study, tmp_path):
    file = tmp_path / "out.rrd"
    replay(study, replace(BARE, save=file))
    shown = []
    assert replay(file, BARE, show=shown.extend) == []
    assert shown == [file]


def test_an_unknown_person_is_told(study):
    with pytest.raises(RecordingUnavailable, match=r"choose from \['P01'\]"):
        replay(study, replace(BARE, participant="P07"))


def test_a_machine_that_cannot_draw_is_told_the_way_out(study, monkeypatch):
    def cannot(world):
        raise NoRenderer("Cannot draw offscreen.")

    monkeypatch.setattr(replay_module, "view_of", cannot)
    with pytest.raises(RecordingUnavailable, match=r"Cannot draw offscreen\. Or .*--no-pictures"):
        replay(study)


def test_the_oracles_way_leads_from_the_start_to_the_ball(drive):
    start = drive.rollout.pose_at(0)
    points = oracle_path(drive.world, start)
    assert points is not None
    assert points[0] == pytest.approx((start.x_m, start.y_m), abs=2.0)  # of the rear axle
    assert points[-1] == pytest.approx(drive.world.ball_xy_m, abs=0.5)


@pytest.mark.render
def test_pictures_are_drawn_by_the_car_s_camera(study, tmp_path):
    replay(study, ReplayConfig(save=tmp_path / "out.rrd", attempt=0))
    paths = {chunk.entity_path for chunk in RrdReader(tmp_path / "out.rrd").stream()}
    assert "/camera" in paths


@pytest.mark.slow
@pytest.mark.render
def test_a_picture_of_the_viewer_is_drawn_without_a_display(study, tmp_path, vulkan):
    from PIL import Image

    png = tmp_path / "pictures" / "replay.png"
    replay(study, replace(BARE, screenshot=png, attempt=0))
    with Image.open(png) as picture:
        assert picture.size == (1600, 900)
        colours = picture.convert("RGB").getcolors(1 << 24)
    assert colours is not None
    seen = {colour for _, colour in colours}
    assert {(240, 228, 66), (86, 180, 233)} <= seen  # the teacher's line and the robot's
