import numpy as np

from steerlab.learning.series import series_from_table
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.labelling import labelled_step, labelled_table
from steerlab.sim.populations import sample_population
from steerlab.sim.records import table_from_steps
from steerlab.sim.store import StudyStore
from steerlab.sim.store_records import StoredRollout
from steerlab.teleop.loop import NullClock, label_rollout

ROLLOUT = load_calibration_set()[3]


class Absent:
    """A device that drops out now and then."""

    name = "absent"

    def begin(self, rollout, *, order, attempt):
        self.begun = (rollout.name, order, attempt)

    def label(self, step):
        return None if step % 10 == 3 else step / 1000.0


class CountingClock:
    def __init__(self):
        self.waited = []

    def wait_for(self, step):
        self.waited.append(step)


def test_each_step_waits_for_the_clock_once_and_in_order():
    clock, teacher, given = CountingClock(), Absent(), []
    labels = label_rollout(
        ROLLOUT,
        teacher,
        order=2,
        attempt=1,
        clock=clock,
        on_label=lambda step, label: given.append((step, label)),
    )
    assert clock.waited == list(range(ROLLOUT.steps))
    assert teacher.begun == (ROLLOUT.name, 2, 1)
    assert [step for step, _ in given] == clock.waited
    assert given[3][1] is None
    assert given[4][1] == labels[4] == 0.004


def test_a_missing_label_stays_missing():
    labels = label_rollout(ROLLOUT, Absent(), order=0, clock=NullClock())
    table = labelled_table(ROLLOUT, labels, participant="p")
    assert table["teacher_label"].null_count == len(range(3, ROLLOUT.steps, 10))
    valid = np.asarray(table["label_valid"])
    np.testing.assert_array_equal(valid, ~np.isnan(labels))
    (series,) = series_from_table(table)
    np.testing.assert_array_equal(series.valid, valid)


def test_the_table_and_the_single_records_are_the_same():
    labels = label_rollout(ROLLOUT, Absent(), order=0, clock=NullClock())
    steps = [
        labelled_step(
            ROLLOUT, step, None if np.isnan(label) else float(label), participant="p", attempt=2
        )
        for step, label in enumerate(labels)
    ]
    table = labelled_table(ROLLOUT, labels, participant="p", attempt=2)
    assert table_from_steps(steps).equals(table)


def test_a_scripted_teacher_through_the_loop_into_the_store(tmp_path):
    """The way a wheel's labels will go: loop, store, table."""
    (teacher,) = sample_population("human", 1, 0, prefix="p")
    with StudyStore.create(tmp_path / "study.db") as store:
        store.add_participant(teacher.name, "training")
        store.add_rollout(StoredRollout.of(ROLLOUT))
        attempt = store.begin_attempt(teacher.name, ROLLOUT.name)
        labels = label_rollout(
            ROLLOUT,
            teacher,
            order=0,
            clock=NullClock(),
            on_label=lambda step, label: store.append(
                labelled_step(ROLLOUT, step, label, participant=teacher.name)
            ),
        )
        store.finish_attempt(attempt)
        stored = store.read_labels()
    assert stored.equals(labelled_table(ROLLOUT, labels, participant=teacher.name))
