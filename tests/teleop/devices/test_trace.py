import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from steerlab.teleop.devices.contract import Button, DeviceError
from steerlab.teleop.devices.trace import TraceDevice, read_trace

ROWS = [
    {"step": 0, "wheel": 0.5, "throttle": 0.25, "brake": None, "buttons": "pause|redo"},
    {"step": 1, "wheel": -2.5, "throttle": None, "brake": 1.0, "buttons": ""},
    {"step": 3, "wheel": None, "throttle": None, "brake": None, "buttons": None},
    {"step": 4, "wheel": 0.1 + 0.2, "throttle": 0.0, "brake": 0.0, "buttons": "take_over"},
]


def played(device, steps=6):
    device.connect()
    device.begin(None, order=0, attempt=0)
    return [device.read(step) for step in range(steps)]


def test_what_was_recorded_is_played_bit_for_bit():
    samples = played(TraceDevice(ROWS))
    assert [sample.wheel for sample in samples] == [0.5, -2.5, None, None, 0.1 + 0.2, None]
    assert (samples[0].throttle, samples[0].brake, samples[1].brake) == (0.25, None, 1.0)
    assert samples[0].buttons == {Button.PAUSE, Button.REDO}


def test_a_gap_is_never_a_repeat():
    samples = played(TraceDevice(ROWS))
    assert [sample.ok for sample in samples] == [True, True, False, False, True, False]
    assert samples[2].wheel is None
    assert samples[2].buttons == frozenset()


def test_without_a_step_it_says_what_it_said_last_and_a_new_attempt_forgets():
    device = TraceDevice(ROWS)
    device.connect()
    assert device.read(1).wheel == device.read().wheel == -2.5
    assert not device.read(2).ok
    assert not device.read().ok
    device.read(1)
    device.begin(None, order=0, attempt=1)
    assert not device.read().ok


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_file_plays_as_its_rows_do(tmp_path, suffix):
    path = tmp_path / f"trace{suffix}"
    table = pa.Table.from_pylist(ROWS)
    if suffix == ".csv":
        pyarrow.csv.write_csv(table, path)
    else:
        pq.write_table(table, path)
    device = read_trace(path)
    assert device.info.name == path.name
    assert played(device) == played(TraceDevice(ROWS))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({"step": 0, "wheel": 2.6}, "row 2: wheel is 2.6"),
        ({"step": 0, "wheel": float("nan")}, "row 2: wheel is nan"),
        ({"step": 0, "wheel": "left"}, "row 2: wheel is 'left'"),
        ({"step": 0, "wheel": 0, "throttle": -0.1}, "row 2: throttle is -0.1"),
        ({"step": 0, "wheel": 0, "brake": 1.1}, "row 2: brake is 1.1"),
        ({"step": 0, "wheel": 0, "buttons": "horn"}, "row 2: no buttons.*horn.*pause, redo"),
        ({"step": -1, "wheel": 0}, "row 2: step is -1"),
        ({"step": 1.5, "wheel": 0}, "row 2: step is 1.5"),
        ({"wheel": 0}, "row 2: step is None"),
        ({"step": 7, "wheel": 0}, "row 2: step 7 is there twice"),
    ],
)
def test_a_row_of_nonsense_is_named(row, words):
    with pytest.raises(DeviceError, match=words):
        TraceDevice([{"step": 7, "wheel": 0.0}, row])


def test_an_empty_trace_is_refused():
    with pytest.raises(DeviceError, match="no rows"):
        TraceDevice([])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("t.txt", "step,wheel\n0,0\n", "no trace"),
        ("t.csv", "step,label\n0,0\n", "columns.*wheel"),
        ("t.csv", "step,wheel,gas\n0,0,0\n", "columns.*gas"),
        ("t.csv", "step,wheel\n0,0,1\n", "row 1: unknown"),
        ("t.parquet", "step,wheel\n0,0\n", "cannot be read"),
    ],
)
def test_a_file_that_is_no_trace_is_refused(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(DeviceError, match=words):
        read_trace(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DeviceError, match="cannot be read"):
        read_trace(tmp_path / "nowhere.csv")
