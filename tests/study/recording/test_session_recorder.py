"""Sessions on record: what is kept, how attempts end, who may record, and what failures say."""

import gc
import threading
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from steerlab.sim.records import labelled_step, step_from_row
from steerlab.study.recording.session_recorder import SessionRecorder
from steerlab.study.recording.writer import RecordingError, WriterThread
from steerlab.study.store.connection import StoreConnection, connect
from steerlab.study.store.errors import StoreError
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.store import StudyStore
from steerlab.teleop.loop import DriveEnd, NullClock, run_drive
from steerlab.teleop.timing_limits import TimingViolation


@pytest.fixture
def study(tmp_path):
    return tmp_path / "study"


def reopened(study):
    return StudyStore.open(study / "study.db", read_only=True)


def test_a_session_is_kept_whole(record, drive, drive_steps, timing_of, study, info):
    failed = [TimingViolation(name="lateness_p99_ms", value=2.5, limit=2.0)]
    with record() as recorder:
        sink = recorder.begin(drive)
        drive_steps(sink, drive, last=5)
        sink.event(5, "takeover")
        drive_steps(sink, drive, first=5)
        sink.finish(failed)
        assert not sink.open
    with reopened(study) as store:
        (attempt,) = store.attempts()
        steps = [step_from_row(row) for row in store.steps(attempt).to_pylist()]
        times = store.timings(attempt).to_pylist()
        (session,) = store.sessions().values()
        assert attempt.status is AttemptStatus.FINISHED
        assert (attempt.attempt, attempt.order_index) == (sink.attempt, sink.order) == (0, 0)
        assert attempt.session == recorder.session == session.id == "P01-1"
        assert [(e.step, e.what) for e in store.events(attempt)] == [(5, "takeover")]
        kept = [(flag.name, flag.value, flag.bound) for flag in store.flags(attempt)]
        assert kept == [(gate.name, gate.value, gate.limit) for gate in failed]
    assert steps == [
        labelled_step(drive.rollout, k, None if k == 1 else 0.1 * k, participant="P01")
        for k in range(drive.rollout.steps)
    ]
    wanted = [{"step": k, **asdict(timing_of(k))} for k in range(drive.rollout.steps)]
    key = {"participant": "P01", "rollout": drive.name, "attempt": 0}
    assert times == [{**key, **row} for row in wanted]
    assert (session.input_kind, session.device_name) == (info.device.kind, info.device.name)
    assert session.device_details == info.device.details
    assert session.screen_px == (960, 540)
    assert session.settings == {"show_agent_wheel": "no"}
    assert session.input_latency_ms is None
    assert "numpy" in session.environment


def test_each_sitting_is_a_session_and_a_redo_a_new_attempt(record, drive, drive_steps, study):
    with record() as recorder:
        redone = recorder.begin(drive)
        drive_steps(redone, drive, last=3)
        redone.abandon("redo")
        drive_steps(again := recorder.begin(drive), drive)
        again.finish()
    with record() as recorder:
        assert recorder.session == "P01-2"
        assert recorder.resumed == []
        third = recorder.begin(drive)
        assert (third.attempt, third.order) == (2, 2)
        third.abandon("enough")
    with reopened(study) as store:
        assert [(a.status, a.end_reason, a.session) for a in store.attempts()] == [
            (AttemptStatus.ABANDONED, "redo", "P01-1"),
            (AttemptStatus.FINISHED, None, "P01-1"),
            (AttemptStatus.ABANDONED, "enough", "P01-2"),
        ]
        assert store.steps(store.attempts()[0]).num_rows == 3


def test_a_live_drive_is_as_long_as_it_lasts(record, drive, drive_steps, study):
    live = SimpleNamespace(
        name="practice", world=drive.world, control_hz=drive.control_hz, rollout=None
    )

    def steps(sink, count):
        for step in range(count):
            taken = labelled_step(drive.rollout, step, 0.1, participant="P01", attempt=sink.attempt)
            sink.step(replace(taken, rollout="practice"), None)

    with record() as recorder:
        for count in (4, 9):
            steps(sink := recorder.begin(live), count)
            sink.finish()
        with pytest.raises(RecordingError, match="has 0 steps"):
            recorder.begin(live).finish()
    with reopened(study) as store:
        assert (store.rollouts()["practice"].steps, store.rollouts()["practice"].seed) == (
            None,
            None,
        )
        assert [store.steps(a).num_rows for a in store.attempts()] == [4, 9, 0]
        assert store.read_labels().num_rows == 9  # the last that was finished
        assert store.attempts()[-1].status is AttemptStatus.ABANDONED


def test_the_loop_records_through_it(record, drive, study):
    device = SimpleNamespace(begin=lambda *a, **k: None, read=lambda step: sample)
    sample = SimpleNamespace(wheel=0.5, ok=True, t_event_ns=None)
    with record() as recorder:
        sink = recorder.begin(drive)
        end = run_drive(
            drive, device, participant="P01", order=sink.order, clock=NullClock(), sink=sink
        )
        sink.finish()
    assert end is DriveEnd.FINISHED
    with reopened(study) as store:
        assert store.read_labels().column("teacher_label").to_pylist() == [0.5] * 12
        assert store.timings().num_rows == 0  # time meant nothing


def test_leaving_in_the_middle_abandons(record, drive, drive_steps, study):
    with record() as recorder:
        drive_steps(recorder.begin(drive), drive, last=2)
        drive_steps(recorder.begin(drive), drive, last=3)
    with reopened(study) as store:
        assert [(a.status, a.end_reason) for a in store.attempts()] == [
            (AttemptStatus.ABANDONED, "another attempt was begun"),
            (AttemptStatus.ABANDONED, "the session ended during it"),
        ]
    with pytest.raises(RecordingError, match="closed; make a new one"):
        recorder.begin(drive)
    recorder.close()


def test_what_a_crash_left_running_is_abandoned_and_redone(record, drive, drive_steps, study):
    with record():
        pass
    with StudyStore.open(study / "study.db") as crashed:
        from steerlab.study.store.records import StoredRollout

        crashed.add_rollout(StoredRollout.of(drive.rollout))
        crashed.append(
            labelled_step(
                drive.rollout,
                0,
                0.5,
                participant="P01",
                attempt=crashed.begin_attempt("P01", drive.name).attempt,
            )
        )
    with record() as recorder:
        assert [str(a) for a in recorder.resumed] == [f"attempt 0 of 'P01' at {drive.name!r}"]
        sink = recorder.begin(drive)
        assert sink.attempt == 1
        drive_steps(sink, drive)
        sink.finish()
    with reopened(study) as store:
        first, second = store.attempts()
        assert (first.status, first.end_reason) == (
            AttemptStatus.ABANDONED,
            "found running after a crash",
        )
        assert store.steps(first).num_rows == 1
        assert second.status is AttemptStatus.FINISHED


def test_two_programs_cannot_record_into_one_study(record, drive):
    with record(), pytest.raises(RecordingError, match="Another program records into"):
        record()
    record().close()


def test_a_folder_that_is_a_file_is_told(tmp_path, info):
    (tmp_path / "taken").write_text("")
    with pytest.raises(RecordingError, match=r"Cannot record into .*taken"):
        SessionRecorder(tmp_path / "taken", info, rerun=False)


def test_a_failed_start_leaves_no_thread_and_no_lock(record, study, info):
    study.mkdir()
    (study / "study.db").write_text("not a database, and longer than a header of one" * 99)
    before = threading.active_count()
    with pytest.raises(StoreError, match="not a SQLite file"):
        record()
    assert threading.active_count() == before
    (study / "study.db").unlink()
    record().close()


def test_a_role_that_changed_is_told(record, info, tmp_path):
    record().close()
    with pytest.raises(StoreError, match="enrolled as 'seen', not 'new'"):
        SessionRecorder(tmp_path / "study", replace(info, role="new"), rerun=False)


class TestFailures:
    """The database fails in the middle of a drive: the loop hears of it, nothing is corrupt."""

    @pytest.fixture
    def broken(self, record, drive, drive_steps, monkeypatch):
        """A recorder with an attempt of three steps, whose database then fails."""
        with record() as recorder:
            sink = recorder.begin(drive)
            drive_steps(sink, drive, last=3)
            recorder._thread.ask(lambda: None)
            with monkeypatch.context() as patch:
                whole = StoreConnection.run

                def full(self, statement, *values):
                    if statement.startswith("INSERT INTO steps"):
                        raise_full()
                    return whole(self, statement, *values)

                patch.setattr(StoreConnection, "run", full)
                yield recorder, sink

    def test_the_next_step_says_so(self, broken, drive, drive_steps):
        recorder, sink = broken
        drive_steps(sink, drive, 3, 4)
        recorder._thread.ask(lambda: None)
        for act in (
            lambda: drive_steps(sink, drive, 4, 5),
            lambda: sink.event(4, "pause"),
            sink.check,
            sink.finish,
        ):
            with pytest.raises(RecordingError, match=r"Cannot keep step 3 .*full.*before is safe"):
                act()

    def test_finishing_says_so_even_right_after(self, broken, drive, drive_steps, study):
        _, sink = broken
        drive_steps(sink, drive, 3, 4)
        with pytest.raises(RecordingError, match="Cannot keep step 3"):
            sink.finish()
        with reopened(study) as store:
            assert store.attempts()[0].status is AttemptStatus.RUNNING

    def test_it_can_be_abandoned_once_there_is_room(self, broken, drive, drive_steps, study):
        recorder, sink = broken
        drive_steps(sink, drive, 3, 6)
        sink.abandon("the disk was full")
        with reopened(study) as store:
            (attempt,) = store.attempts()
            assert attempt.status is AttemptStatus.ABANDONED
            assert attempt.end_reason.startswith("the disk was full; steps are missing: Cannot")
            assert store.steps(attempt).num_rows == 3
        assert recorder.begin(drive).attempt == 1


def raise_full():
    import sqlite3

    error = sqlite3.OperationalError("database or disk is full")
    error.sqlite_errorcode = sqlite3.SQLITE_FULL
    raise error


def test_another_programs_lock_is_told(record, drive, drive_steps, study, monkeypatch):
    monkeypatch.setattr("steerlab.study.store.connection.BUSY_TIMEOUT_S", 0.05)
    with record() as recorder:
        sink = recorder.begin(drive)
        other = connect(study / "study.db", read_only=False)
        try:
            other.execute("BEGIN IMMEDIATE")
            drive_steps(sink, drive, last=1)
            with pytest.raises(RecordingError, match="locked; another program holds it"):
                sink.finish()
        finally:
            other.close()
        sink.abandon("redo")


def test_a_hole_in_the_steps_is_not_finished(record, drive, drive_steps):
    with record() as recorder:
        sink = recorder.begin(drive)
        drive_steps(sink, drive, last=3)
        drive_steps(sink, drive, first=4)
        with pytest.raises(RecordingError, match="has 11 steps"):
            sink.finish()


def test_an_invalid_step_is_told(record, drive, timing_of):
    with record() as recorder:
        sink = recorder.begin(drive)
        step = labelled_step(drive.rollout, 0, 0.5, participant="P01")
        sink.step(replace(step, x_m=float("nan")), timing_of(0))
        with pytest.raises(RecordingError, match="x_m is nan"):
            sink.finish()


def test_the_writer_thread_answers_with_what_was_raised():
    thread = WriterThread()
    with pytest.raises(ZeroDivisionError):
        thread.ask(lambda: 1 / 0)
    assert thread.ask(lambda: 7) == 7
    thread.stop()
    thread.stop()
    with pytest.raises(RecordingError, match="closed"):
        thread.ask(lambda: 7)


def test_it_works_without_garbage_collection(record, drive, drive_steps):
    gc.disable()
    try:
        with record() as recorder:
            drive_steps(sink := recorder.begin(drive), drive)
            sink.finish()
    finally:
        gc.enable()
    assert Path(recorder.folder / "study.db").is_file()
