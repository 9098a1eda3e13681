"""Recordings made from the database alone."""

import os
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from steerlab.study.recording.rebuild import open_study, rebuild_recording
from steerlab.study.recording.scene import about
from steerlab.study.recording.viewer import RecordingUnavailable
from steerlab.study.store.records import StoredRollout
from steerlab.study.store.store import StudyStore


class Grey:
    """Draws nothing but the step it is asked for, and knows whether it was closed."""

    def __init__(self, world):
        self.poses, self.open = [], True

    def __enter__(self):
        return self

    def __exit__(self, *why):
        self.open = False

    def frame(self, pose, road_wheel_rad=0.0):
        self.poses.append(pose)
        return np.full((27, 48, 3), 3 * len(self.poses), np.uint8)


def rows(file, path, recording=0):
    reader = RrdReader(file)
    return [
        row
        for chunk in reader.stream(store=reader.recordings()[recording])
        if chunk.entity_path == path
        for row in chunk.to_record_batch().to_pylist()
    ]


def values(rows, name):
    return [row[name] for row in rows if row.get(name) is not None]


def test_a_recording_holds_what_the_database_holds(study, tmp_path):
    out = tmp_path / "a" / "one.rrd"
    (attempt,) = rebuild_recording(study, out, participant="P01", rollout="calibration-00")
    assert attempt.key == ("P01", "calibration-00", 0)
    with open_study(study) as store:
        steps = store.attempt_data(attempt).steps
    wheels = rows(out, "/wheels")
    lines = values(wheels, "Scalars:scalars")
    assert len(lines) == 30
    for step, (label, robot, oracle) in zip(steps, lines, strict=True):
        assert (robot, oracle) == (step.robot_wheel, step.oracle_label)
        assert np.isnan(label) if step.teacher_label is None else label == step.teacher_label
    assert values(wheels, "SeriesLines:names") == [["teacher's label", "robot's wheel", "oracle"]]
    places = values(rows(out, "/world/car"), "Transform3D:translation")
    np.testing.assert_allclose(
        [place[0][:2] for place in places], [(s.x_m, s.y_m) for s in steps], rtol=1e-6
    )
    ways = values(rows(out, "/world/car/ways"), "LineStrips3D:strips")
    assert [len(way) for way in ways] == [2 if 5 <= k < 8 else 3 for k in range(30)]
    driven = rows(out, "/world/paths/driven")
    (strips,) = values(driven, "LineStrips3D:strips")
    assert [len(strip) for strip in strips] == [11, 11, 10]  # each goes on where the last ended
    assert values(driven, "LineStrips3D:labels") == [
        ["the robot drove", "the teacher drove", "the robot drove"]
    ]
    assert values(rows(out, "/events"), "TextLog:text") == [["takeover"]]
    assert rows(out, "/camera") == []
    assert rows(out, "/world/paths/oracle") == []
    assert os.listdir(tmp_path / "a") == ["one.rrd"]


def test_all_attempts_of_a_study_go_into_one_file(study, tmp_path):
    told = []
    attempts = rebuild_recording(
        study, tmp_path / "all.rrd", progress=lambda what, share: told.append(share)
    )
    assert len(attempts) == 4
    reader = RrdReader(tmp_path / "all.rrd")
    assert {entry.recording_id for entry in reader.recordings()} == {
        "/".join(map(str, attempt.key)) for attempt in attempts
    }
    assert len(reader.blueprints()) == 4
    assert told == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_pictures_and_the_oracles_way_are_added(study, tmp_path):
    views = []

    def open_view(world):
        views.append(Grey(world))
        return views[-1]

    rebuild_recording(
        study,
        tmp_path / "one.rrd",
        participant="P02",
        rollout="calibration-01",
        open_view=open_view,
        oracle_path=lambda world, start: np.array([(start.x_m, start.y_m), world.ball_xy_m]),
    )
    pictures = rows(tmp_path / "one.rrd", "/camera")
    assert [row["step"] for row in pictures] == list(range(0, 30, 2))  # 10 Hz of 20
    assert all(bytes(row["EncodedImage:blob"][0])[:2] == b"\xff\xd8" for row in pictures)
    assert len(views) == 1
    assert not views[0].open
    (way,) = values(rows(tmp_path / "one.rrd", "/world/paths/oracle"), "LineStrips3D:strips")
    assert len(way[0]) == 2


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"participant": "P99"}, r"No participant 'P99' in .*choose from \['P01', 'P02'\]"),
        (
            {"participant": "P01", "rollout": "x"},
            r"No rollout 'x'.*\['calibration-00', 'calibration-01'\]",
        ),
        ({"attempt": 3}, r"No attempt 3 in .*choose from \[0\]"),
    ],
)
def test_a_wrong_choice_is_told_with_the_right_ones(study, tmp_path, chosen, message):
    with pytest.raises(RecordingUnavailable, match=message):
        rebuild_recording(study, tmp_path / "out.rrd", **chosen)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_a_study_is_told(tmp_path):
    with pytest.raises(RecordingUnavailable, match=r"There is no study\.db in"):
        rebuild_recording(tmp_path, tmp_path / "out.rrd")


def test_an_empty_study_is_told(empty_study, tmp_path):
    with pytest.raises(RecordingUnavailable, match="holds no attempt yet"):
        rebuild_recording(empty_study, tmp_path / "out.rrd")


def test_an_attempt_without_steps_is_told(study, tmp_path):
    with open_study(study) as whole:
        rollout = next(iter(whole.rollouts().values()))
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant("P01", "seen")
        store.add_rollout(rollout)
        store.begin_attempt("P01", rollout.name)
    with pytest.raises(RecordingUnavailable, match="No step was recorded in attempt 0"):
        rebuild_recording(tmp_path, tmp_path / "out.rrd")


def test_a_place_that_cannot_be_written_is_told(study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingUnavailable, match=r"Cannot write .*choose another file"):
        rebuild_recording(study, tmp_path / "file" / "out.rrd", participant="P01")


def test_the_database_itself_serves_as_path(study, tmp_path):
    assert rebuild_recording(study / "study.db", tmp_path / "out.rrd", participant="P01")


def test_what_a_reader_must_know(study):
    with open_study(study) as store:
        data = store.attempt_data(store.attempts()[0])
    text = about(data)
    for word in (
        "P01",
        "finished",
        "30 at 20 Hz, 27 labels valid",
        "lateness_p99_ms 2.5 (limit 2)",
        "G29 \\| red (wheel)",
        "7.25 ms",
    ):
        assert word in text
    alone = replace(data, session=None, flags=[])
    assert "| flags | none |" in about(alone)
    assert "device" not in about(alone)


def test_the_drive_begins_at_its_first_step_or_at_the_worlds_start(study):
    with open_study(study) as store:
        data = store.attempt_data(store.attempts()[0])
    assert data.start.x_m == data.steps[0].x_m
    assert isinstance(data.rollout, StoredRollout)
    assert replace(data, steps=[]).start == data.rollout.world.start
