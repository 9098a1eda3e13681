"""Somebody teaches before a window: in time that is simulated, and on a display of its own."""

import json
import shutil
from hashlib import sha256
from types import SimpleNamespace

import numpy as np
import pytest

from steerlab.learning.agents import PolicyLearner, make_agent
from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.gates import TeacherDrives
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.agents.teaching_contract import AfterRest
from steerlab.sim.errors import SteerlabError
from steerlab.sim.rollout import Outcome
from steerlab.study.store.store import StudyStore
from steerlab.study.store.teaching import read_targets, read_taught, read_teaching_rounds
from steerlab.study.study import Study
from steerlab.study.teaching import run_teaching
from steerlab.study.teaching.conditions import FIRST_DURING, TAUGHT
from steerlab.study.teaching.human_interface import HumanInterface
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.devices.contract import Button, DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.screen.contract import Act
from tests.teleop.display import Display

MS = 1_000_000


class Room:
    """Screen, device, recorder and time in one; ``on_page`` presses keys."""

    info = DeviceInfo(kind=InputKind.WHEEL, name="G29")
    focused = True

    def __init__(self) -> None:
        self.ns = 0
        self.pages, self.views, self.log, self._acts = [], [], [], []
        self.sample = DeviceSample(wheel=0.0, t_event_ns=0)
        self.on_page = lambda page: None
        self.frame_ns = 5 * MS

    def now_ns(self):
        self.ns += 1000
        return self.ns

    def sleep_s(self, seconds):
        self.ns += round(seconds * 1e9)

    def acts(self):
        acts, self._acts = self._acts, []
        return acts

    def press(self, *acts):
        self._acts += acts

    def show_page(self, page):
        self.pages.append(page)
        self.on_page(page)

    def show_drive(self, view):
        self.ns += self.frame_ns
        self.views.append(view)

    def begin(self, drive_or_rollout, **kwargs):
        if not kwargs:  # the recorder's
            self.log.append(("begin", drive_or_rollout.name))
            return SimpleNamespace(
                order=0,
                attempt=len(self.log),
                step=lambda step, timing: None,
                event=lambda step, what: self.log.append(("event", what)),
                finish=lambda failed: self.log.append(("finish", [one.name for one in failed])),
                abandon=lambda reason: self.log.append(("abandon", reason)),
            )
        return None

    def read(self, step=None):
        return self.sample

    def interface(self, condition="dagger"):
        return HumanInterface(
            screen=self,
            device=self,
            poll=lambda: None,
            recorder=self,
            participant="P001",
            mode=TAUGHT[condition],
            title="Teaching robot 1 of 3",
            count=3,
            config=SessionConfig(countdown_s=0.5),
            now_ns=self.now_ns,
            sleep_s=self.sleep_s,
        )

    def keys(self):
        return [dict(page.keys) for page in self.pages]


@pytest.fixture
def room() -> Room:
    return Room()


def slowly(room, shares):
    def work(tick):
        for share in shares:
            room.ns += 150 * MS
            tick(share)

    return work


def test_the_person_rests_while_it_learns_and_goes_on_only_then(room):
    room.on_page = lambda page: room.press(Act.CONFIRM)  # impatient from the start
    interface = room.interface()
    learn, meanwhile = slowly(room, [0.0, 0.4, 0.8, 1.0]), slowly(room, [0.1, 0.5, 1.0])
    assert interface.rest(1, Outcome.BLOCK_HIT, learn, meanwhile) is AfterRest.GO_ON
    bars = [dict(page.bars)["Learning"] for page in room.pages]
    assert bars[:4] == [0.0, 0.4, 0.8, 1.0]
    assert all("Space" not in keys for keys in room.keys()[:4])
    assert "Space" in room.keys()[4]
    assert room.pages[0].title == "Rollout 2 of 3 is done"
    assert "Rest your hands" in room.pages[0].lines[1]
    assert len(room.pages) <= 6  # what goes on meanwhile was dropped
    assert interface.rests_ns == [pytest.approx(600 * MS, rel=0.1)]


@pytest.mark.parametrize("act", [Act.REDO, Act.STOP])
def test_a_redo_or_a_stop_ends_the_learning_at_once(room, act):
    learnt = []

    def learn(tick):
        for share in np.linspace(0.0, 1.0, 50):
            room.ns += 150 * MS
            tick(share)
            learnt.append(share)

    room.on_page = lambda page: len(room.pages) == 3 and room.press(act)
    assert (
        room.interface().rest(0, Outcome.BALL_REACHED, learn, lambda tick: None)
        is AfterRest[act.name]
    )
    assert len(learnt) == 3
    room.on_page = lambda page: None
    assert room.acts() == []  # it was taken


def test_what_cannot_be_learnt_is_shown_before_it_is_raised(room):
    def learn(tick):
        raise SteerlabError("The policy's loss is nan.")

    with pytest.raises(SteerlabError):
        room.interface().rest(0, Outcome.BALL_REACHED, learn, lambda tick: None)
    assert room.pages[-1].tone == "error"
    assert "The policy's loss is nan." in room.pages[-1].lines


def test_waiting_can_be_stopped_and_nothing_else_is_heard(room):
    room.on_page = lambda page: room.press(Act.CONFIRM, Act.REDO)
    assert room.interface().wait("Trying out", slowly(room, [0.0, 0.5, 1.0]))
    room.on_page = lambda page: room.press(Act.STOP)
    assert not room.interface().wait("Trying out", slowly(room, [0.0, 0.5, 1.0]))


@pytest.fixture
def round_drive(short_world):
    with TaskEnv(run_teaching.make_task("easy", noise=0.0), seed=0) as env:
        context = env.context("one", number=0, order=0, attempt=0)
        yield RoundDrive(env=env, context=context, gate=TeacherDrives(), learner=None, seed=1)


def test_a_drive_with_its_words_a_pause_a_redo_and_a_finish(room, round_drive):
    done = []

    def answer(page):
        if "Space" in dict(page.keys):
            room.press(Act.CONFIRM)

    def interrupt(view):
        show(view)
        begun = sum(entry[0] == "begin" for entry in room.log)
        if view.elapsed_s > 0.5 and begun not in done and begun < 3:
            done.append(begun)
            room.press([None, Act.PAUSE, Act.REDO][begun])

    show, room.show_drive, room.on_page = room.show_drive, interrupt, answer
    interface = room.interface()
    drove = interface.drive(round_drive)
    assert drove.outcome is Outcome.BALL_REACHED
    assert len(drove.seen) > 20
    assert [entry for entry in room.log if entry[0] != "event"] == [
        ("begin", "one"),
        ("abandon", "paused"),
        ("begin", "one"),
        ("abandon", "redo"),
        ("begin", "one"),
        ("finish", []),
    ]
    assert ("event", "outcome: ball_reached") in room.log
    titles = [page.title for page in room.pages]
    assert titles[0] == "Teaching robot 1 of 3"
    assert "you drive" in room.pages[0].lines[0]
    assert "Pause" in titles
    assert {view.instruction for view in room.views} == {FIRST_DURING}
    assert len(interface.health) == 1
    room.on_page = lambda page: room.press(Act.STOP)
    assert interface.drive(round_drive) is None  # what is to be done was said already
    assert room.pages[-1].title == "Rollout 1 of 3"


def test_a_drive_that_the_computer_could_not_keep_up_with_is_offered_again(room, round_drive):
    asked = []

    def answer(page):
        if "could not keep time" in page.lines[0]:
            asked.append(page)
            room.frame_ns = 5 * MS
            room.press(Act.REDO if len(asked) == 1 else Act.CONFIRM)
        elif "Space" in dict(page.keys):
            room.press(Act.CONFIRM)

    room.on_page, room.frame_ns = answer, 60 * MS
    assert room.interface().drive(round_drive) is not None
    finished = [entry for entry in room.log if entry[0] == "finish"]
    assert "dropped_share" in finished[0][1]
    assert len(finished) == 2  # it was done again once, and taken as it was the second time


def test_a_button_for_redo_on_the_wheel_is_heard_while_it_learns(room):
    def on_page(page):
        if len(room.pages) == 2:
            room.sample = DeviceSample(wheel=0.0, t_event_ns=0, buttons=frozenset({Button.REDO}))

    room.on_page = on_page
    learn = slowly(room, np.linspace(0.0, 1.0, 9))
    assert (
        room.interface().rest(0, Outcome.BALL_REACHED, learn, lambda tick: None) is AfterRest.REDO
    )


def test_a_take_over_button_must_be_heard_before_the_first_round_of_takeovers(room, short_world):
    with TaskEnv(run_teaching.make_task("easy", noise=0.0), seed=0) as env:
        context = env.context("one", number=1, order=0, attempt=0)
        gate = make_agent("hg-dagger", {}).gate
        round_drive = RoundDrive(
            env=env, context=context, gate=gate, learner=PolicyLearner(0), seed=1
        )

        def answer(page):
            if page.title == "Try the take-over button":
                assert "G29 may have no button" in page.lines[1]
                room.sample = DeviceSample(
                    wheel=0.0, t_event_ns=0, buttons=frozenset({Button.TAKE_OVER})
                )
            elif page.big:  # the countdown
                room.press(Act.STOP)
            elif "Space" in dict(page.keys):
                room.press(Act.CONFIRM)

        room.on_page = answer
        interface = room.interface("hg_dagger")
        assert interface.drive(round_drive) is None
        titles = [page.title for page in room.pages]
        assert titles.count("Try the take-over button") == 1
        room.pages.clear()
        assert interface.drive(round_drive) is None  # once is enough
        assert [page.title for page in room.pages] == ["Rollout 2 of 3"]
        room.sample = DeviceSample(wheel=0.0, t_event_ns=0)
        room.on_page = lambda page: room.press(
            Act.STOP if "take-over" in page.title else Act.CONFIRM
        )
        assert room.interface("hg_dagger").drive(round_drive) is None
        assert room.pages[-1].title == "Try the take-over button"


@pytest.mark.slow
@pytest.mark.display
@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="not installed: Xvfb")
def test_a_person_corrects_a_live_round_and_takes_over_in_another(folder, tmp_path):
    text = (folder / "study.toml").read_text()
    with Study.open(folder, read_only=True) as study:
        order = study.participant("P001").order
    names = dict(zip(order, ("mind_meld", "hg_dagger", "bc"), strict=True))
    for number, before in enumerate(order):
        text = text.replace(f'key = "{before}"', f'key = "{number}"', 1)
    for number, after in enumerate(names.values()):
        text = text.replace(f'key = "{number}"', f'key = "{after}"', 1)
    text = text.replace("demonstrations = 2 ", "demonstrations = 1 ", 1)
    amend(folder, text, json.dumps([*names.values()]))
    display = Display(tmp_path)
    try:
        plan = {"short": True, "hold": [0.5, 1.5], "leave": "Teaching robot 3"}
        arguments = ("--participant", "P001", "--no-recordings")
        child = display.run("virtual_teacher.py", plan, "study", "run", str(folder), *arguments)
        out, err = child.communicate(timeout=250)
    finally:
        display.close()
    assert child.returncode == 0, out + err
    assert out.count("Rest your hands while the robot learns from it.") >= 4
    assert out.count(": 2 of 2 drives taught") == 2
    assert "Try the take-over button" in out
    assert "Teaching robot 3 of 3: stopped; 0 of 2 drives taught" in out
    with StudyStore.open(folder / "study.db", read_only=True) as store:
        for phase in ("teach-1", "teach-2"):
            shown, taught = read_taught(store.connection, "P001", phase)
            assert shown.outcome is Outcome.BALL_REACHED
            last = [one for one in store.attempts() if one.rollout == taught.rollout][-1]
            steps = store.steps(last)
            gates = steps["gate"].to_pylist()
            label = steps["teacher_label"].to_numpy()
            assert np.isfinite(label).all()
            assert label.std() > 0.0
            assert store.timings(last).num_rows == len(gates)
            targets = read_targets(store.connection, taught)
            if phase == "teach-1":
                assert set(gates) == {"robot"}
                assert targets.asked.all()
                assert taught.mapper_sha256 is not None
            else:
                assert set(gates) == {"robot", "teacher"}
                assert 5 < targets.asked.sum() < len(targets.asked)
                assert taught.switches == 2
        rows = read_teaching_rounds(store.connection).to_pylist()
        assert [row["trials"] for row in rows] == [2, 2, 2, 2]
        assert list(store.sessions().values())[-1].input_kind == "wheel"
    measured = json.loads(out[out.index("measured ") :].removeprefix("measured ").splitlines()[0])
    assert len(measured["rest_s"]) == 4


def amend(folder, text, order):
    """As if the protocol had been so from the start; nobody has taught anything yet."""
    (folder / "study.toml").write_text(text)
    with StudyStore.open(folder / "study.db") as store:
        raw = store.connection.sqlite
        for trigger in ("update_of_protocols", "update_of_enrolments"):
            raw.execute(f"DROP TRIGGER {trigger}")
        digest = sha256(text.encode()).hexdigest()
        raw.execute("UPDATE protocols SET text = ?, sha256 = ?", (text, digest))
        raw.execute(
            "UPDATE enrolments SET condition_order = ? WHERE participant = 'P001'", (order,)
        )
