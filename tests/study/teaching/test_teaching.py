"""Scripted participants teach, headless: the loop, its record, and what may go wrong in it."""

import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from steerlab.learning.agents import catalogue, gates, label_rules
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.gates import TeacherDrives
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.offline import play
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching import BallNeverReached
from steerlab.learning.checkpoint import load_mapper
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.policy_training import TrainingDiverged
from steerlab.learning.series import LabelSeries
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.live_teacher import LiveTeacher
from steerlab.sim.records import Driver, table_from_steps
from steerlab.sim.rollout import Outcome
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.tasks import NAMED_TASKS
from steerlab.study.contract import PhaseKind, PhaseState
from steerlab.study.protocol import CONDITIONS, TASKS
from steerlab.study.protocol_file import parse_protocol
from steerlab.study.runner import RunConfig
from steerlab.study.store.people import PhaseAct, insert_phase_event
from steerlab.study.store.records import AttemptStatus
from steerlab.study.store.teaching import (
    read_targets,
    read_taught,
    read_teaching_rounds,
    read_tried,
)
from steerlab.study.study import Study
from steerlab.study.teaching import conditions, run_teaching, teaching_log
from steerlab.study.teaching.conditions import TAUGHT, TeacherAction
from steerlab.study.teaching.contract import TeachingError, all_teachings
from steerlab.study.teaching.live_round import GateDecides, make_live_round
from steerlab.study.teaching.scripted_interface import LiveScriptedDevice
from steerlab.study.teaching.teaching_log import episode_of, rerender_observations
from steerlab.teleop.devices.contract import DeviceError, DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.devices.trace import TraceDevice
from steerlab.teleop.loop import LabelSink, NullClock, run_drive


def of(store, phase="teach-1", participant="P001"):
    return read_taught(store.connection, participant, phase)


def attempts(store, *statuses):
    found = store.attempts(*statuses)
    return [(one.rollout, one.attempt) for one in found if "teach" in one.rollout]


class Fixed:
    """Holds the wheel at ``wheel`` in its first ``drives`` drives, and straight from then on."""

    info = DeviceInfo(kind=InputKind.SCRIPTED, name="fixed")

    def __init__(self, wheel: float = 0.0, drives: int = 10**6) -> None:
        self.wheel, self.drives, self.begun = wheel, drives, 0

    def connect(self):
        pass

    def disconnect(self):
        pass

    def begin(self, rollout, *, order, attempt):
        self.begun += 1

    def read(self, step=None):
        return DeviceSample(wheel=self.wheel if self.begun <= self.drives else 0.0)


def test_a_whole_scripted_participant_teaches_every_condition_in_order(folder, script, short_world):
    with Study.open(folder) as study:
        config = RunConfig(
            device=script.device, pages=script, recordings=False, teachings=all_teachings()
        )
        report = study.run("P001", config)
        assert report.waiting is None
        assert sum(": 3 of 3 drives taught" in line for line in report.lines) == 3
        view = study.participant("P001")
        taught = [one for one in view.phases if one[0].kind is PhaseKind.TEACH]
        assert {state for _, state in taught} == {PhaseState.DONE}
        assert tuple(phase.condition for phase, _ in taught) == view.order
        store = study._opened.store
        rows = read_teaching_rounds(store.connection).to_pylist()
        assert [(row["condition"], row["round"]) for row in rows] == [
            (condition, number) for condition in view.order for number in range(3)
        ]
        assert all(row["trials"] == 2 and np.isfinite(row["final_distance_m"]) for row in rows)
        began = [one for one in store.audit() if one.act == "round taught"]
        assert [one.detail.split()[1] for one in began] == sorted(
            f"teach-{n}" for n in (1, 2, 3) for _ in range(3)
        )
        session = list(store.sessions().values())[-1]
        assert session.settings["condition"] == view.order[-1]
        assert session.settings["protocol_version"] == "1"
        findings = study.verify().findings
        assert [one.found for one in findings if not one.ok] == []
        assert "9 rounds, their policies as they were kept" in [one.found for one in findings]
        (name,) = read_taught(store.connection, "P001", "teach-2")[1].policies
        (folder / name).unlink()
        said = [one.found for one in study.verify().findings if not one.ok]
        assert said == [f"teach-2: {folder / name} is missing"]


def test_labels_are_mapped_with_the_participants_own_w_after_the_first_drive(
    teach, store, folder, short_world
):
    assert teach("mind_meld", rounds=2).detail == "3 of 3 drives taught"
    (path,) = (folder / "models").glob("mind_meld-*-P001.safetensors")
    mapper = load_mapper(path)
    first, *rounds = of(store)
    (attempt,) = [one for one in store.attempts() if one.rollout == first.rollout]
    driven = store.steps(attempt)["teacher_label"].to_numpy()[::2]
    np.testing.assert_array_equal(read_targets(store.connection, first).target, driven)
    assert first.mapper_sha256 is None
    for taught in rounds:
        (attempt,) = [one for one in store.attempts() if one.rollout == taught.rollout]
        steps = store.steps(attempt)
        label = steps["teacher_label"].to_numpy()
        unknown = np.full(len(label), np.nan)
        series = LabelSeries(
            person="P001",
            rollout="any",
            rate_hz=20.0,
            label=label,
            truth=unknown,
            valid=np.zeros(len(label), dtype=bool),
        )
        found = read_targets(store.connection, taught)
        np.testing.assert_allclose(found.target, mapper.map(series)[::2], atol=1e-6)
        assert not np.allclose(found.target, label[::2])
        truth = steps["oracle_label"].to_numpy()[::2]
        assert taught.label_mae == pytest.approx(np.nanmean(np.abs(found.target - truth)))
        assert taught.given_mae == pytest.approx(np.nanmean(np.abs(label[::2] - truth)))
        assert taught.mapper_sha256 == teaching_log.sha256(path.read_bytes()).hexdigest()


def test_dagger_learns_the_labels_as_they_are_and_bc_drives_itself(teach, store, short_world):
    teach("dagger")
    (_, taught), (attempt, *_) = of(store), store.attempts()
    (attempt,) = [one for one in store.attempts() if one.rollout == taught.rollout]
    steps = store.steps(attempt)
    label = steps["teacher_label"].to_numpy()
    np.testing.assert_array_equal(read_targets(store.connection, taught).target, label[::2])
    assert set(steps["gate"].to_pylist()) == {Driver.ROBOT.value}
    assert taught.teacher_s == pytest.approx(len(label[::2]) / 10.0)


@pytest.mark.parametrize("condition", TAUGHT)
def test_everything_a_protocol_may_name_can_be_taught(teach, store, short_world, condition):
    assert teach(condition, plan={"gradient_steps": 2, "starts": 1}).finished
    first, taught = of(store)
    assert first.outcome is Outcome.BALL_REACHED
    assert taught.condition == condition
    gates = {
        one.rollout: set(store.steps(one)["gate"].to_pylist())
        for one in store.attempts()
        if "teach" in one.rollout
    }
    assert gates[first.rollout] == {"teacher"}
    hands = TAUGHT[condition].hands
    if hands is TeacherAction.DRIVE:
        assert gates[taught.rollout] == {"teacher"}
    elif hands is TeacherAction.LABEL:
        assert gates[taught.rollout] == {"robot"}


def test_what_can_be_taught_is_what_there_is():
    assert {one.learner for one in TAUGHT.values()} <= set(catalogue.LEARNERS)
    left = set(catalogue.LEARNERS) - {one.learner for one in TAUGHT.values()}
    assert {name for name in left if not name.startswith("mapped:")} == {"dagger-beta"}
    assert CONDITIONS[:3] == ("mind_meld", "bc", "dagger")
    assert TASKS == NAMED_TASKS
    assert set(conditions._BEFORE) == set(conditions._DURING) == set(TeacherAction)


def test_the_first_drive_is_done_again_until_it_reaches_the_ball(teach, store, short_world):
    assert teach("bc", device=Fixed(wheel=2.5, drives=1)).finished
    finished = attempts(store, AttemptStatus.FINISHED)
    names = [f"teach-1-bc-slalom-r{number:02d}" for number in (0, 0, 1)]
    assert finished == [(names[0], 0), (names[1], 1), (names[2], 0)]
    assert [one.attempt for one in of(store)] == [1, 0]


def test_who_never_reaches_the_ball_is_told_and_may_try_again(teach, store, short_world):
    with pytest.raises(BallNeverReached, match=r"P001 did not reach the ball.* in 2 first drives"):
        teach("dagger", device=Fixed(wheel=2.5))
    assert of(store) == []
    assert len(attempts(store, AttemptStatus.FINISHED)) == 2
    assert teach("dagger", device=Fixed()).finished
    assert of(store)[0].attempt == 2


def test_a_loss_that_is_no_number_keeps_the_drive_and_the_robot_and_the_round_is_driven_anew(
    teach, store, short_world, monkeypatch
):
    train, calls = PolicyLearner.train, []

    def diverge(self, episodes, *progress):
        calls.append(len(episodes))
        if len(episodes) == 2 and calls.count(2) <= 2:
            train(self, episodes, *progress)  # the weights are spoilt
            raise TrainingDiverged("The policy's loss is nan at step 3 of 6.")
        return train(self, episodes, *progress)

    monkeypatch.setattr("steerlab.study.teaching.run_teaching.warm_up", lambda *them: None)
    monkeypatch.setattr(PolicyLearner, "train", diverge)
    with pytest.raises(TeachingError, match=r"Round 1 of P001.*loss is nan.*The drive is kept"):
        teach("dagger")
    assert [one.round for one in of(store)] == [0]
    assert teach("dagger").finished
    assert [one.round for one in of(store)] == [0, 1]
    assert attempts(store, AttemptStatus.FINISHED)[-1][1] == 1  # driven twice
    monkeypatch.setattr(PolicyLearner, "train", train)
    before = of(store)[1].policies
    assert teach("dagger", rounds=2).finished
    assert of(store)[1].policies == before


def test_a_round_without_labels_is_kept_and_leaves_the_robot_as_it_was(teach, store, short_world):
    assert teach("hg_dagger", device=Fixed(), rounds=2).finished
    first, second, third = of(store)
    assert first.labels_asked > 0
    for taught in (second, third):
        assert (taught.labels_asked, taught.loss, taught.label_mae) == (0, None, None)
        assert [*taught.policies.values()] == [*first.policies.values()]


def test_a_scripted_person_takes_over_when_it_is_dangerous(teach, store, short_world, monkeypatch):
    monkeypatch.setitem(
        catalogue.PLAIN,
        "hg-dagger",
        lambda: Agent(
            name="hg-dagger",
            gate=gates.RiskGate(take=0.05, give_back=0.01),
            rule=label_rules.WhereTeacherDrives(),
        ),
    )
    teach("hg_dagger")
    _, taught = of(store)
    assert taught.labels_asked > 0
    assert taught.switches > 0


def test_a_gate_that_changes_its_mind_leaves_a_person_the_wheel_for_a_second():
    class Restless:
        watching, needs_doubt = "", False

        def begin(self, number, rng):
            self.asked = 0

        def who_drives(self, moment):
            self.asked += 1
            assert moment.teacher_wheel == 1.0
            return Driver.TEACHER if self.asked % 2 else Driver.ROBOT

    gate = Restless()
    drive = SimpleNamespace(gate=gate, number=1, gate_rng=lambda: np.random.default_rng(0))
    who = GateDecides(drive, SimpleNamespace(doubt=0.5))
    for _ in range(2):
        who.begin()
        gates = [who.command(0.0, DeviceSample(wheel=1.0)).gate for _ in range(60)]
        held = [gates[:22], gates[22:24], gates[24:46]]
        assert [set(part) for part in held] == [{Driver.TEACHER}, {Driver.ROBOT}, {Driver.TEACHER}]
        assert gate.asked == 30  # at decisions only


def test_what_the_robot_saw_can_be_seen_again_from_its_poses(folder, script, short_world):
    """Bit for bit, on one machine: so a crash costs nobody a drive."""

    class Sink(LabelSink):
        steps = ()

        def step(self, step, timing):
            self.steps = (*self.steps, step)

    task = run_teaching.make_task("easy", noise=0.5)
    with TaskEnv(task, seed=0) as env:
        context = env.context("one", number=0, order=0, attempt=0)
        drive = RoundDrive(env=env, context=context, gate=TeacherDrives(), learner=None, seed=1)
        live = make_live_round(drive, TAUGHT["dagger"])
        sink = Sink()
        run_drive(
            live.drive,
            LiveScriptedDevice(script.teacher, live),
            participant="P001",
            order=0,
            clock=NullClock(),
            sink=sink,
        )
        table, seen = table_from_steps(sink.steps), live.robot.seen
        again = rerender_observations(env, table)
        np.testing.assert_array_equal(again.image, seen.image)
        np.testing.assert_array_equal(again.motion, seen.motion)
        assert len(np.unique(seen.image, axis=0)) > 20
        episode = episode_of(env, table, seen, live.drive.outcome, 0)
        assert len(episode.rows) == len(seen) == len(live.robot.decision_ns)
        executed = table["executed_wheel"].to_numpy()
        noise = (executed - table["teacher_label"].to_numpy())[:40].reshape(-1, 2)
        np.testing.assert_allclose(noise[:, 0], noise[:, 1], atol=1e-12)  # one value a decision
        assert noise.std() > 0.2


def test_who_is_sparse_rests_while_the_robot_they_label_is_right(script, short_world):
    tolerant = ScriptedTeacher("t", replace(script.teacher.style, tolerance=4.9), 0)
    labels = {}
    for condition in ("bc", "dagger"):
        mode = TAUGHT[condition]
        gate = catalogue.make_agent(mode.learner, {}).gate
        with TaskEnv(run_teaching.make_task("easy", noise=0.5), seed=0) as env:
            context = env.context("one", number=1, order=0, attempt=0)
            drive = RoundDrive(
                env=env, context=context, gate=gate, learner=PolicyLearner(2), seed=1
            )
            live = make_live_round(drive, mode)
            device = LiveScriptedDevice(tolerant, live)
            device.begin(None, order=0, attempt=0)
            env.driving.reset(start=drive.start.pose)
            labels[condition] = [device.read(step).wheel for step in range(3)]
    assert labels["dagger"] == [0.0, 0.0, 0.0]  # a label of 0, not none
    assert 0.0 not in labels["bc"]  # at the wheel nobody rests


@pytest.mark.parametrize("condition", ["bc", "dagger"])
def test_a_drive_in_real_time_is_the_drive_of_a_script_that_waits_for_nobody(
    script, short_world, condition
):
    class Sink(LabelSink):
        steps = ()

        def step(self, step, timing):
            self.steps = (*self.steps, step)

    mode = TAUGHT[condition]
    gate = catalogue.make_agent(mode.learner, {}).gate
    with TaskEnv(run_teaching.make_task("easy", noise=0.5), seed=0) as env:
        context = env.context("one", number=1, order=0, attempt=0)
        drive = RoundDrive(env=env, context=context, gate=gate, learner=PolicyLearner(2), seed=1)
        alone = play(drive, script.teacher, LiveTeacher(script.teacher, "softened"))
        live, sink = make_live_round(drive, mode), Sink()
        run_drive(
            live.drive,
            LiveScriptedDevice(script.teacher, live),
            participant=script.teacher.name,
            order=0,
            clock=NullClock(),
            sink=sink,
        )
        table = table_from_steps(sink.steps)
        watched = episode_of(env, table, live.robot.seen, live.drive.outcome, 1)
    assert watched.outcome is alone.outcome
    np.testing.assert_array_equal(watched.rollout.pose, alone.rollout.pose)
    np.testing.assert_array_equal(watched.learner_wheel, alone.learner_wheel)
    np.testing.assert_array_equal(watched.teacher_drives, alone.teacher_drives)
    np.testing.assert_array_equal(watched.live, alone.live)
    np.testing.assert_array_equal(watched.seen.image, alone.seen.image)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from conftest import short_task
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from steerlab.study.teaching import run_teaching, teaching_log
from steerlab.study.teaching.contract import all_teachings

run_teaching.make_task = short_task
count = 0

def die_at(number, call, after=False):
    def wrapped(*arguments, **named):
        global count
        count += 1
        found = call(*arguments, **named) if after else None
        if count == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return found if after else call(*arguments, **named)
    return wrapped

where = sys.argv[3]
if where == "between rounds":
    teaching_log.StudyTeachingLog.keep = die_at(2, teaching_log.StudyTeachingLog.keep, after=True)
elif where == "policy saved, round not":
    teaching_log.insert_round = die_at(2, teaching_log.insert_round)
script = ScriptedParticipant(kind="human", seed=3)
with Study.open(Path(sys.argv[2])) as study:
    phase = study.participant("P001").next_phase.id
    study.run("P001", RunConfig(device=script.device, pages=script, recordings=False, phase=phase,
                                teachings=all_teachings()))
print("survived")
"""


def go_on(folder: Path, script):
    with Study.open(folder) as study:
        config = RunConfig(
            device=script.device,
            pages=script,
            recordings=False,
            phase="teach-1",
            teachings=all_teachings(),
        )
        study.run("P001", config)
        store = study._opened.store
        rows = read_teaching_rounds(store.connection).to_pylist()
        return [one.policies for one in of(store)], rows


@pytest.mark.slow
@pytest.mark.parametrize("where", ["between rounds", "policy saved, round not"])
def test_a_run_that_was_killed_goes_on_and_ends_as_if_nothing_had_happened(
    folder, tmp_path, store, script, short_world, where
):
    whole = go_on(Path(shutil.copytree(folder, tmp_path / "whole")), script)
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(Path(__file__).parent), str(folder), where],
        capture_output=True,
        text=True,
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    before = attempts(store)
    policies, rows = go_on(folder, script)
    finished = [name for name, _ in attempts(store, AttemptStatus.FINISHED)]
    assert len(finished) == len(set(finished)) == 3  # nothing is driven twice
    assert before == attempts(store)[: len(before)]
    assert policies == whole[0]
    assert rows == whole[1]
    assert read_tried(store.connection, "P001", "teach-1") == {0, 1, 2}


def test_a_drive_that_was_to_be_done_again_is_not_learnt_from_after_a_crash(
    teach, store, folder, short_world
):
    teach("dagger")
    first, task = of(store)[0], SimpleNamespace(name="slalom")
    log = teaching_log.StudyTeachingLog(
        folder,
        store,
        SimpleNamespace(task=task),
        participant="P001",
        phase="teach-1",
        condition="dagger",
        mapper_sha256=None,
    )
    found = log.left_over(0)
    assert (found.name, found.attempt, found.number) == (first.rollout, 0, 0)
    assert (found.outcome, found.seen) == (Outcome.BALL_REACHED, None)
    again = store.begin_attempt("P001", first.rollout)  # R, and then a crash
    store.abandon_attempt(again, "found running after a crash")
    assert log.left_over(0) is None
    assert log.left_over(7) is None  # never driven


def test_policies_that_cannot_be_kept_cost_no_drive(teach, store, short_world, monkeypatch):
    save = teaching_log.save_policy

    def full(network, path):
        if "r01" in path.name:
            raise OSError(28, "No space left on device")
        save(network, path)

    monkeypatch.setattr(teaching_log, "save_policy", full)
    with pytest.raises(TeachingError, match=r"round 1 cannot be kept.*No space left.*make room"):
        teach("dagger")
    assert [one.round for one in of(store)] == [0]
    monkeypatch.setattr(teaching_log, "save_policy", save)
    assert teach("dagger").finished
    assert len(attempts(store)) == 2


def test_a_policy_that_was_changed_is_not_gone_on_from(teach, store, folder, short_world):
    teach("dagger")
    (name,) = of(store)[1].policies
    (folder / name).write_bytes(b"nothing")
    with pytest.raises(TeachingError, match=r"is not the policy that round 1 of P001 left"):
        teach("dagger", rounds=2)
    with Study.open(folder) as study:
        connection = study._opened.store.connection
        with connection.transaction("as if the runner had"):
            insert_phase_event(connection, "P001", "teach-1", PhaseAct.STARTED)
        assert study.participant("P001").progress == "2 of 3 drives"
        with connection.transaction("as if the runner had"):
            insert_phase_event(connection, "P001", "teach-1", PhaseAct.DONE)
        said = [one.found for one in study.verify().findings if not one.ok]
        assert said == ["teach-1: it is done, but has 2 of 3 rounds"]


def test_a_mapper_without_the_participant_is_refused_before_anything_is_driven(
    teach, store, folder, short_world, monkeypatch
):
    monkeypatch.setattr(MindMeldMapper, "calibrated", ("P002",))
    with pytest.raises(TeachingError, match=r"holds no w of P001.*study redo"):
        teach("mind_meld")
    assert attempts(store) == []


def test_a_trace_cannot_teach(teach, store, short_world):
    trace = TraceDevice([{"step": 0, "wheel": 0.0}], name="x.csv")
    with pytest.raises(DeviceError, match=r"a robot that learns drives anew each time"):
        teach("dagger", device=trace)
    assert attempts(store) == []


def test_a_phase_opened_again_is_taught_anew(folder, script, short_world):
    config = RunConfig(
        device=script.device,
        pages=script,
        recordings=False,
        teachings=all_teachings(),
        phase="teach-1",
    )
    with Study.open(folder) as study:
        study.run("P001", config)
        connection = study._opened.store.connection
        before = read_taught(connection, "P001", "teach-1")
        study.redo("P001", "teach-1")
        assert read_teaching_rounds(connection).num_rows == 0
        study.run("P001", config)
        after = read_taught(connection, "P001", "teach-1")
        assert [one.phase_run for one in after] == [1, 1, 1]
        assert not {*after[2].policies} & {*before[2].policies}
        assert [one.attempt for one in after] == [1, 1, 1]
        study.withdraw("P001", erase=True)
        assert read_teaching_rounds(connection).num_rows == 0
    assert not [*(folder / "models" / "policies").glob("*")]


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('task = "slalom" ', 'task = "slolom" ', "teaching.task is 'slolom'; it must be one of"),
        ("noise = 0.2 ", "noise = -1.0 ", "teaching.noise is -1.0; it must be from 0 to 2.5"),
        ("starts = 2 ", "starts = 0 ", "teaching.starts is 0; it must be a whole number, at least"),
        ("starts = 2 ", "start = 2 ", "did you mean 'starts'"),
        ("rate = 0.002", 'rate = "low"', "teaching.rate is 'low'; it must be a finite number"),
        ("learner_seed = 0 ", "learner_seed = -3 ", "teaching.learner_seed is -3"),
    ],
)
def test_what_is_wrong_with_the_teaching_is_named_with_its_line(folder, before, after, said):
    text = (folder / "study.toml").read_text()
    assert before in text
    line = text[: text.index(before)].count("\n") + 1
    with Study.open(folder, read_only=True) as study, pytest.raises(InvalidConfig) as refused:
        parse_protocol(text.replace(before, after, 1), "s.toml", study._opened.questionnaires)
    assert f"s.toml, line {line}: " in str(refused.value)
    assert said in str(refused.value)


def test_starts_and_noise_are_the_participants_and_the_same_in_all_conditions():
    assert run_teaching.participant_seed(0, "P001") == run_teaching.participant_seed(0, "P001")
    assert (
        len(
            {
                run_teaching.participant_seed(seed, who)
                for seed in (0, 1)
                for who in ("P001", "P002")
            }
        )
        == 4
    )
