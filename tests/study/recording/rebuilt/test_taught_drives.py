"""A teacher's recording: what it holds, that it repeats, and that it is whole or not there."""

import numpy as np
import pytest
from rerun.chunk import RrdReader

from steerlab.analysis.taught_drives import (
    DRIVE,
    TaughtDrives,
    drive_poses,
    write_taught_drives,
)
from steerlab.sim.tasks import make_task
from steerlab.study.recording.viewer import RecordingUnavailable

LEARNERS = ("dagger", "mapped:person_gain")


def _taught(points: int) -> dict:
    path = [[-40.0 + 2.5 * step, 0.1 * step] for step in range(points)]
    rounds = [
        {"round": 0, "path_m": path, "success": 0.25},
        {"round": 1, "path_m": path[:3], "success": None},
        {"round": 2, "path_m": path[:2], "success": 1.0},
    ]
    drive = {"outcome": "ball_reached", "final_distance_m": 4.4, "path_m": path}
    return {"by_round": rounds, "final_drives": [drive, drive | {"path_m": path[:4]}]}


@pytest.fixture
def drives() -> TaughtDrives:
    return TaughtDrives(
        teacher="test-000",
        world=make_task("slalom").world,
        conditions=dict(zip(LEARNERS, (_taught(8), _taught(12)), strict=True)),
        about="**test-000**",
    )


def _rows(file, path):
    reader = RrdReader(file)
    return [
        row
        for chunk in reader.stream(store=reader.recordings()[0])
        if chunk.entity_path == path
        for row in chunk.to_record_batch().to_pylist()
    ]


def _values(rows, name):
    return [row[name] for row in rows if row.get(name) is not None]


def test_every_learner_and_every_drive_is_in_it(drives, tmp_path):
    out = tmp_path / "one.rrd"
    write_taught_drives(drives, out)
    for key, points in (("dagger", 8), ("mapped-person_gain", 12)):
        taught = _rows(out, f"/world/teaching/{key}")
        assert _values(taught, "round") == [0, 1, 2]
        cars = _rows(out, f"/world/cars/{key}")
        numbers = _values(cars, DRIVE)
        assert set(numbers) == {0, 1}
        assert numbers.count(0) == 5 * (points - 1) + 1  # ten times a second
        (strips,) = _values(_rows(out, f"/world/judged/{key}"), "LineStrips3D:strips")
        assert [len(strip) for strip in strips] == [points, 4]
        success = _values(_rows(out, f"/success/{key}"), "Scalars:scalars")
        assert success == [[0.25], [1.0]]  # nothing where nobody was judged
    assert [path.name for path in tmp_path.iterdir()] == ["one.rrd"]


def test_learners_set_off_together_from_each_start(drives, tmp_path):
    write_taught_drives(drives, tmp_path / "one.rrd")
    begins = []
    for key in ("dagger", "mapped-person_gain"):
        rows = [row for row in _rows(tmp_path / "one.rrd", f"/world/cars/{key}") if "t" in row]
        second = [row["t"] for row in rows if row.get(DRIVE) == 1]
        begins.append(min(second))
    assert begins[0] == begins[1]


def test_equal_drives_give_equal_data(drives, tmp_path):
    for name in ("a", "b"):
        write_taught_drives(drives, tmp_path / f"{name}.rrd")
    one, two = (_rows(tmp_path / f"{name}.rrd", "/world/cars/dagger") for name in ("a", "b"))
    assert one
    assert [{k: v for k, v in row.items() if "RowId" not in k} for row in one] == [
        {k: v for k, v in row.items() if "RowId" not in k} for row in two
    ]


def test_poses_follow_the_path():
    t_s, poses = drive_poses(np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]))
    assert t_s == pytest.approx(np.arange(11) / 10.0)
    assert poses[5] == pytest.approx([2.0, 0.0, np.pi / 4.0])
    assert poses[2, :2] == pytest.approx([0.8, 0.0])
    assert poses[-1] == pytest.approx([2.0, 2.0, np.pi / 2.0])
    alone = drive_poses(np.array([(1.0, 2.0)]))[1]
    assert alone.tolist() == [[1.0, 2.0, 0.0]]


def test_a_place_that_cannot_be_written_is_named_and_left_clean(drives, tmp_path):
    with pytest.raises(RecordingUnavailable, match=r"one\.rrd"):
        write_taught_drives(drives, tmp_path / "missing" / "one.rrd")
    assert list(tmp_path.iterdir()) == []
