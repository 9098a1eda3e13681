"""A study of two people and two rollouts, written as a session would, without Rerun."""

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.records import Driver, labelled_step
from steerlab.study.store.records import Event, Flag, SessionRecord, StoredRollout
from steerlab.study.store.store import StudyStore

STEPS = 30


@dataclass(frozen=True)
class Times:
    deadline_ns: int
    actual_ns: int
    sample_ns: int
    event_age_ns: int | None
    overrun: bool = False
    focus: bool = True
    device_ok: bool = True


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    with StudyStore.create(folder / "study.db") as store:
        for person in ("P01", "P02"):
            store.add_participant(person, "seen")
            session = SessionRecord(
                id=f"{person}-1",
                participant=person,
                started_utc="2026-01-02T03:04:05+00:00",
                input_kind="wheel",
                device_name="G29 | red",
                control_hz=20.0,
                input_latency_ms=7.25,
                steerlab_version="0.1.0",
            )
            store.add_session(session)
            for rollout in load_calibration_set()[:2]:
                stored = StoredRollout.of(rollout)
                store.add_rollout(replace(stored, steps=STEPS))
                attempt = store.begin_attempt(person, rollout.name, session=session.id)
                for k in range(STEPS):
                    label = None if 5 <= k < 8 else 0.05 * k
                    step = labelled_step(rollout, k, label, participant=person)
                    gate = Driver.TEACHER if 10 <= k < 20 else Driver.ROBOT
                    due_ns = 50_000_000 * k
                    times = Times(
                        due_ns, due_ns + 40_000, due_ns + 60_000, 2_000_000 if k else None
                    )
                    store.append(replace(step, gate=gate), times)
                store.add_event(attempt, Event(step=10, at_ns=0, what="takeover"))
                store.finish_attempt(attempt, [Flag(name="lateness_p99_ms", value=2.5, bound=2.0)])
    return folder


@pytest.fixture(scope="session")
def empty_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("empty")
    StudyStore.create(folder / "study.db").close()
    return folder
