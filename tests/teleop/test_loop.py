import numpy as np

from steerlab.learning.series import series_from_table
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.sim.records import labelled_step, labelled_table, table_from_steps
from steerlab.study.store.records import StoredRollout
from steerlab.study.store.store import StudyStore
from steerlab.teleop.devices.contract import DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.loop import DriveEnd, LabelSink, NullClock, label_rollout, run_drive
from steerlab.teleop.pacing import Tick

ROLLOUT = load_calibration_set()[3]


class Absent:
    """A teacher whose device drops out now and then."""

    name = "absent"

    def begin(self, rollout, *, order, attempt):
        self.begun = (rollout.name, order, attempt)

    def label(self, step):
        return None if step % 10 == 3 else step / 1000.0


class CountingClock:
    """Every step comes due late by its own number of ns."""

    overrun_ns = 100

    def __init__(self):
        self.waited = []
        self.started = 0

    def start(self):
        self.started += 1

    def wait_for(self, step, show):
        self.waited.append((step, show))
        return Tick(1000 * step, 1000 * step + step)


class Keep:
    def __init__(self):
        self.kept = []

    def step(self, step, timing):
        self.kept.append((step, timing))


class Still:
    """A device that never moves, last heard at 5 ns."""

    info = DeviceInfo(kind=InputKind.WHEEL, name="still")

    def begin(self, rollout, *, order, attempt):
        self.begun = (rollout, order, attempt)

    def read(self, step=None):
        return DeviceSample(wheel=0.25, t_event_ns=5)


class StopsAt:
    focused = True

    def __init__(self, step):
        self.left = step

    def interruption(self, sample):
        self.left -= 1
        return DriveEnd.PAUSED if self.left < 0 else None


def run(clock, sink, *, device=None, watch=None, show=None):
    return run_drive(
        Replay(ROLLOUT),
        device or Still(),
        participant="p",
        order=2,
        attempt=1,
        clock=clock,
        sink=sink,
        watch=watch,
        show=show,
        now_ns=lambda: 7_000_000,
    )


def test_each_step_waits_for_the_clock_once_and_in_order():
    clock, sink, device = CountingClock(), Keep(), Still()
    show = object()
    assert run(clock, sink, device=device, show=show) is DriveEnd.FINISHED
    assert clock.started == 1
    assert clock.waited == [(step, show) for step in range(ROLLOUT.steps)]
    assert device.begun == (ROLLOUT, 2, 1)
    assert [step.step for step, _ in sink.kept] == list(range(ROLLOUT.steps))
    assert {(step.participant, step.attempt) for step, _ in sink.kept} == {("p", 1)}


def test_timing_says_what_the_clock_and_the_device_said():
    sink = Keep()
    run(CountingClock(), sink)
    timings = [timing for _, timing in sink.kept]
    assert timings[42].deadline_ns == 42_000
    assert timings[42].lateness_ns == 42
    assert timings[42].sample_ns == 7_000_000
    assert timings[42].event_age_ns == 7_000_000 - 5
    assert [timing.overrun for timing in timings] == [n >= 100 for n in range(len(timings))]
    assert all(timing.focus and timing.device_ok for timing in timings)


def test_an_interruption_ends_the_drive_before_its_step_is_kept():
    sink = Keep()
    assert run(CountingClock(), sink, watch=StopsAt(17)) is DriveEnd.PAUSED
    assert [step.step for step, _ in sink.kept] == list(range(17))


def test_a_null_clock_gives_no_timing():
    sink = Keep()
    run(NullClock(), sink)
    assert {timing for _, timing in sink.kept} == {None}


def test_a_missing_label_stays_missing():
    labels = label_rollout(ROLLOUT, Absent(), order=0)
    table = labelled_table(ROLLOUT, labels, participant="p")
    assert table["teacher_label"].null_count == len(range(3, ROLLOUT.steps, 10))
    valid = np.asarray(table["label_valid"])
    np.testing.assert_array_equal(valid, ~np.isnan(labels))
    (series,) = series_from_table(table)
    np.testing.assert_array_equal(series.valid, valid)


def test_the_table_and_the_single_records_are_the_same():
    labels = label_rollout(ROLLOUT, Absent(), order=0)
    steps = [
        labelled_step(
            ROLLOUT, step, None if np.isnan(label) else float(label), participant="p", attempt=2
        )
        for step, label in enumerate(labels)
    ]
    table = labelled_table(ROLLOUT, labels, participant="p", attempt=2)
    assert table_from_steps(steps).equals(table)


class StoreSink:
    def __init__(self, store):
        self.store = store

    def step(self, step, timing):
        self.store.append(step)


def test_a_scripted_teacher_through_the_loop_into_the_store(tmp_path):
    """The way a wheel's labels go: loop, store, table."""
    (teacher,) = sample_population("human", 1, 0, prefix="p")
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant(teacher.name, "training")
        store.add_rollout(StoredRollout.of(ROLLOUT))
        attempt = store.begin_attempt(teacher.name, ROLLOUT.name)
        run_drive(
            Replay(ROLLOUT),
            ScriptedDevice(teacher),
            participant=teacher.name,
            order=0,
            clock=NullClock(),
            sink=StoreSink(store),
        )
        store.finish_attempt(attempt)
        stored = store.read_labels()
    labels = label_rollout(ROLLOUT, teacher, order=0)
    assert np.isfinite(labels).all()
    assert stored.equals(labelled_table(ROLLOUT, labels, participant=teacher.name))


def test_the_label_sink_keeps_nan_for_none():
    sink = LabelSink()
    run(NullClock(), sink, device=ScriptedDevice(Absent()))
    labels = sink.labels()
    assert np.isnan(labels[3])
    assert labels[4] == 0.004
