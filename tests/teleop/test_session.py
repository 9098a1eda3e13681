"""A whole session with a person who is simulated, and with time that is."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import SteerlabError
from steerlab.sim.rollout import Outcome
from steerlab.teleop.attempt import SessionConfig
from steerlab.teleop.devices.contract import Button, DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.page_prompt import with_buttons
from steerlab.teleop.pages import drive_done_page
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.session import DriveSession, SessionEnd

MS = 1_000_000


def short(rollout, steps=25):
    columns = (
        "t_s",
        "pose",
        "velocity",
        "acceleration",
        "robot_wheel",
        "oracle_label",
        "oracle_valid",
        "physics_state",
    )
    return replace(rollout, **{name: getattr(rollout, name)[:steps] for name in columns})


ROLLOUTS = [short(rollout) for rollout in load_calibration_set()[:3]]


class Lab:
    """Screen, device, recorder and time in one: what each did, in order."""

    info = DeviceInfo(kind=InputKind.WHEEL, name="G29")

    def __init__(self):
        self.ns = 0
        self.focused = True
        self.sample = DeviceSample(wheel=0.0, t_event_ns=0)
        self.pages, self.views, self.log = [], [], []
        self.on_page = self.answer
        self.on_step = lambda attempt, step: None
        self.frame_ns = 5 * MS
        self._acts = []

    # time
    def now_ns(self):
        self.ns += 1000
        return self.ns

    def sleep_s(self, seconds):
        self.ns += round(seconds * 1e9)

    # screen
    def acts(self):
        acts, self._acts = self._acts, []
        return acts

    def press(self, *acts):
        self._acts += acts

    def enter(self, world):
        self.log.append(("enter", world.name))

    def show_page(self, page):
        self.pages.append(page)
        self.on_page(page)

    def show_drive(self, view):
        self.ns += self.frame_ns
        self.views.append(view)

    def answer(self, page):
        """Go on wherever one may."""
        if ("Space", "go on") in page.keys or ("Space", "close") in page.keys:
            self.press(Act.CONFIRM)

    # device
    def begin(self, rollout_or_drive, **kwargs):
        if kwargs:  # the device's
            return None
        self.log.append(("begin", rollout_or_drive.name))  # the recorder's
        return Record(self, len([entry for entry in self.log if entry[0] == "begin"]) - 1)

    def read(self, step=None):
        return self.sample

    def session(self, **settings):
        return DriveSession(
            screen=self,
            device=self,
            poll=lambda: None,
            recorder=self,
            participant="p",
            total=len(ROLLOUTS),
            config=SessionConfig(**settings),
            now_ns=self.now_ns,
            sleep_s=self.sleep_s,
        )

    def run(self, **settings):
        return self.session(**settings).run(map(Replay, ROLLOUTS))

    def titles(self):
        return [page.title for page in self.pages]


class Record:
    def __init__(self, lab, number):
        self.lab, self.attempt, self.order = lab, 0, number
        self.steps = []

    def step(self, step, timing):
        self.steps.append(step)
        assert timing is not None
        self.lab.on_step(self.order, step.step)

    def event(self, step, what):
        self.lab.log.append(("event", step, what))

    def finish(self, failed):
        self.lab.log.append(("finish", len(self.steps), [gate.name for gate in failed]))

    def abandon(self, reason):
        self.lab.log.append(("abandon", len(self.steps), reason))


def test_three_drives_from_the_first_countdown_to_thank_you():
    lab = Lab()
    assert lab.run() is SessionEnd.DONE
    names = [rollout.name for rollout in ROLLOUTS]
    worlds = [rollout.world.name for rollout in ROLLOUTS]
    assert lab.log == [
        entry
        for name, world in zip(names, worlds, strict=True)
        for entry in (("enter", world), ("begin", name), ("finish", 25, []))
    ]
    assert lab.pages[0].title == "Rollout 1 of 3"
    assert lab.pages[-1].title == "Thank you"
    assert {page.big for page in lab.pages if page.title == "Rollout 1 of 3"} == {"3", "2", "1"}
    numbers = [view.number for view in lab.views]
    assert numbers == sorted(numbers)
    assert set(numbers) == {1, 2, 3}


def test_the_countdown_waits_until_the_wheel_is_centred_and_starts_over_if_it_leaves():
    lab = Lab()
    lab.sample = DeviceSample(wheel=1.0)
    centred_at = []

    def page(page):
        lab.answer(page)
        if len(lab.pages) == 30:
            lab.sample = DeviceSample(wheel=0.1)
        if len(lab.pages) == 60:
            lab.sample = DeviceSample(wheel=-0.3)
        if len(lab.pages) == 70:
            lab.sample = DeviceSample(wheel=0.0)
            centred_at.append(lab.ns)

    lab.on_page = page
    started = []
    lab.on_step = lambda attempt, step: started.append(lab.ns)
    lab.run()
    assert "Centre the wheel" in lab.pages[5].lines[0]
    assert lab.pages[5].big == ""
    assert lab.pages[50].big == "3"
    assert lab.pages[65].big == ""
    assert 3.0 <= (started[0] - centred_at[0]) / 1e9 < 3.2


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("pause key", "paused"),
        ("pause button", "paused"),
        ("redo key", "redo"),
        ("redo button", "redo"),
        ("focus", "the window lost the focus"),
        ("short focus", "the window lost the focus"),
        ("unplugged", "the device was lost"),
    ],
)
def test_an_interruption_redoes_the_drive_from_step_0_as_a_new_attempt(how, reason):
    lab = Lab()

    def interrupt(attempt, step):
        if (attempt, step) != (1, 10):
            return
        match how:
            case "pause key":
                lab.press(Act.PAUSE)
            case "redo key":
                lab.press(Act.REDO)
            case "pause button":
                lab.sample = replace(lab.sample, buttons=frozenset({Button.PAUSE}))
            case "redo button":
                lab.sample = replace(lab.sample, buttons=frozenset({Button.REDO}))
            case "focus":
                lab.focused = False
            case "short focus":
                lab.press(Act.FOCUS_LOST)
            case "unplugged":
                lab.sample = DeviceSample(wheel=None, ok=False)

    def page(page):
        lab.answer(page)
        lab.sample = DeviceSample(wheel=0.0)
        if page.title == "Pause":
            assert "start again from the beginning" in page.lines[-1]
            lab.focused = True

    lab.on_step, lab.on_page = interrupt, page
    assert lab.run() is SessionEnd.DONE
    names = [rollout.name for rollout in ROLLOUTS]
    kept = [entry for entry in lab.log if entry[0] != "enter"]
    assert kept == [
        ("begin", names[0]),
        ("finish", 25, []),
        ("begin", names[1]),
        ("event", 11, reason),
        ("abandon", 11, reason),
        ("begin", names[1]),
        ("finish", 25, []),
        ("begin", names[2]),
        ("finish", 25, []),
    ]
    assert ("Pause" in lab.titles()) == (reason != "redo")


def test_a_pause_lasts_until_the_device_is_back_and_says_so():
    lab = Lab()
    waited = []

    def unplug(attempt, step):
        if (attempt, step) == (0, 5):
            lab.sample = DeviceSample(wheel=None, ok=False)

    def page(page):
        if page.title == "Pause":
            waited.append(page)
            lab.press(Act.CONFIRM)  # in vain while it is unplugged
            if len(waited) == 50:
                lab.sample = DeviceSample(wheel=0.0)
        lab.answer(page)

    lab.on_step, lab.on_page = unplug, page
    assert lab.run() is SessionEnd.DONE
    assert len(waited) >= 50
    assert any("plug it in" in line for line in waited[10].lines)
    assert waited[10].tone == "warning"
    assert ("Space", "go on") not in waited[10].keys


def test_stopping_keeps_what_is_done_and_abandons_what_is_not():
    lab = Lab()
    lab.on_step = lambda attempt, step: lab.press(Act.STOP) if (attempt, step) == (1, 3) else None
    assert lab.run() is SessionEnd.STOPPED
    assert [entry[0] for entry in lab.log if entry[0] in ("finish", "abandon")] == [
        "finish",
        "abandon",
    ]


def test_a_computer_that_cannot_keep_time_is_told_and_a_redo_is_offered():
    lab = Lab()

    def freeze(attempt, step):
        if (attempt, step) == (0, 8):
            lab.ns += 300 * MS

    def page(page):
        if page.tone == "warning" and "do it again" in page.lines[-1]:
            lab.press(Act.REDO)
        else:
            lab.answer(page)

    lab.on_step, lab.on_page = freeze, page
    assert lab.run() is SessionEnd.DONE
    finished = [entry for entry in lab.log if entry[0] == "finish"]
    assert [gates != [] for _, _, gates in finished] == [True, False, False, False]
    assert "overrun_share" in finished[0][2]


def test_steps_that_cannot_be_kept_stop_the_session_with_the_reason_on_screen():
    lab = Lab()

    def full(attempt, step):
        if step == 12:
            raise SteerlabError("The disk is full; free some room.")

    lab.on_step = full
    with pytest.raises(SteerlabError, match="disk is full"):
        lab.run()
    assert lab.pages[-1].tone == "error"
    assert "The disk is full; free some room." in lab.pages[-1].lines
    assert [entry for entry in lab.log if entry[0] == "finish"] == []


def test_the_needle_is_the_persons_and_the_robots_wheel_is_hidden_by_default():
    lab = Lab()
    lab.sample = DeviceSample(wheel=0.12)
    lab.run()
    assert {view.needle for view in lab.views} == {0.12}
    assert {view.agent_needle for view in lab.views} == {None}
    assert {view.road_wheel_rad for view in lab.views} == {0.0}

    shown = Lab()
    shown.run(show_agent_wheel=True)
    wheels = np.concatenate([rollout.robot_wheel for rollout in ROLLOUTS])
    assert {view.agent_needle for view in shown.views} <= set(wheels.tolist())
    assert len({view.road_wheel_rad for view in shown.views}) > 10


def test_the_end_of_a_drive_stays_on_the_screen_for_a_moment_and_is_not_recorded():
    ends = []
    for ending_s in (0.0, 0.8):
        lab = Lab()
        assert lab.run(ending_s=ending_s) is SessionEnd.DONE
        ends.append([view.outcome for view in lab.views if view.outcome is not Outcome.RUNNING])
        kept = [entry[1] for entry in lab.log if entry[0] == "finish"]
        assert kept == [rollout.steps for rollout in ROLLOUTS]
    assert ends[0] == []
    shown = list(dict.fromkeys(ends[1]))
    assert shown == list(dict.fromkeys(rollout.outcome for rollout in ROLLOUTS))
    assert len(ends[1]) > 10 * len(ROLLOUTS)


def test_the_speed_shown_is_the_recorded_one():
    lab = Lab()
    lab.run()
    speeds = [view.speed_mps for view in lab.views]
    assert min(speeds) >= 0.0
    assert max(speeds) == pytest.approx(max(one.velocity[:, 0].max() for one in ROLLOUTS))


def test_pages_name_the_buttons_that_the_wheel_has_and_no_others():
    page = drive_done_page(Outcome.BALL_REACHED, (), 1, 12)
    assert with_buttons(page, frozenset()).keys == list(page.keys)
    keys = dict(with_buttons(page, frozenset({Button.PAUSE})).keys)
    assert keys["Space"] == "go on (or the pause button)"
    assert keys["R"] == "do this rollout again"
    keys = dict(with_buttons(page, frozenset(Button)).keys)
    assert keys["R"] == "do this rollout again (or the redo button)"
    assert keys["Esc"] == dict(page.keys)["Esc"]
