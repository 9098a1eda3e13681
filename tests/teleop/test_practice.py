"""Practising, by a person who simply steers at the ball."""

import pytest

from steerlab.sim.geometry import bearing_rad
from steerlab.teleop.devices.contract import DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.practice import Practice, PracticeConfig
from steerlab.teleop.screen.contract import Act


class Lab:
    """Screen, device and time in one."""

    info = DeviceInfo(kind=InputKind.WHEEL, name="G29")
    focused = True

    def __init__(self, away_from_the_ball=0):
        self.ns = 0
        self.pages, self.views, self.worlds = [], [], []
        self._acts = []
        self.wrong = away_from_the_ball  # this many drives go the other way first
        self.driving = False

    def now_ns(self):
        self.ns += 1000
        return self.ns

    def sleep_s(self, seconds):
        self.ns += round(seconds * 1e9)

    def acts(self):
        acts, self._acts = self._acts, []
        return acts

    def enter(self, world):
        self.worlds.append(world)

    def show_page(self, page):
        self.pages.append(page)
        self.driving = page.over_drive
        keys = dict(page.keys)
        if "Space" in keys:
            self.wrong -= 1
            self._acts.append(Act.CONFIRM)

    def show_drive(self, view):
        self.views.append(view)

    def begin(self, rollout, *, order, attempt):
        assert rollout is None
        self.began = len(self.views)

    def read(self, step=None):
        if step is None:
            return DeviceSample(wheel=0.0, throttle=self.throttle(), brake=0.0)
        pose = self.views[-1].pose
        wheel = 4.0 * bearing_rad(pose, self.worlds[-1].ball_xy_m)
        if self.wrong > 0:
            wheel = 0.0  # straight off the ground or into a block
        return DeviceSample(wheel=max(-2.5, min(2.5, wheel)), throttle=self.throttle(), brake=0.0)

    def throttle(self):
        return 0.6

    def practise(self, **settings):
        practice = Practice(
            screen=self,
            device=self,
            poll=lambda: None,
            config=PracticeConfig(**settings),
            now_ns=self.now_ns,
            sleep_s=self.sleep_s,
        )
        return practice.run()


def test_balls_are_counted_and_each_lies_in_a_world_of_its_own():
    lab = Lab()
    result = lab.practise(balls=2, seed=0)
    assert result.balls == 2
    assert not result.stopped
    assert [world.name for world in lab.worlds] == ["practice-0", "practice-1"]
    assert lab.worlds[0] != lab.worlds[1]
    assert lab.pages[-1].title == "Well driven"
    assert {view.balls for view in lab.views} == {0, 1}
    assert not any(view.recording for view in lab.views)


def test_a_drive_that_fails_is_driven_again_in_the_same_world():
    lab = Lab(away_from_the_ball=1)
    result = lab.practise(balls=1, seed=0)
    assert result.balls == 1
    assert len(lab.worlds) == 1
    titles = [page.title for page in lab.pages]
    assert "0 of 1 balls" in titles


def test_practice_is_over_after_its_time_too_and_the_drive_under_way_is_finished():
    whole = Lab().practise(balls=3, seed=0)
    assert whole.balls == 3
    lab = Lab()
    result = lab.practise(balls=3, driven_s=1.0, seed=0)
    assert (result.balls, result.stopped) == (1, False)
    assert 1.0 < result.driven_s < whole.driven_s / 2.0
    assert lab.pages[-1].title == "Well driven"
    enough = Lab().practise(balls=3, driven_s=3600.0, seed=0)
    assert (enough.balls, enough.driven_s) == (3, whole.driven_s)


def test_time_counts_in_drives_that_fail_as_well():
    lab = Lab(away_from_the_ball=2)
    result = lab.practise(balls=1, driven_s=0.1, seed=0)
    assert (result.balls, len(lab.worlds), result.stopped) == (0, 1, False)
    assert result.driven_s > 0.1


def test_stopping_in_the_countdown():
    lab = Lab()
    lab._acts = []

    def stop(page):
        lab._acts.append(Act.STOP)

    lab.show_page = stop
    result = lab.practise(balls=1)
    assert result.stopped
    assert (result.balls, result.driven_s) == (0, 0.0)


def test_pedals_that_said_nothing_yet_are_asked_for():
    lab = Lab()
    asked = []
    show = lab.show_page

    def look(page):
        asked.extend([page.title] * (page.title == "Press each pedal once"))
        show(page)

    lab.show_page = look
    lab.throttle = lambda: 0.6 if len(asked) > 3 else None
    assert lab.practise(balls=1, seed=0).balls == 1
    assert len(asked) == 4
    unknown = Lab()
    unknown.throttle = lambda: None
    unknown.show_page = lambda page: unknown._acts.append(Act.STOP)
    assert unknown.practise(balls=1, seed=0).stopped
    cruising = Lab()
    cruising.throttle = lambda: None
    assert cruising.practise(balls=1, seed=0, pedals=False).balls == 1


def test_practising_for_nothing_is_refused():
    with pytest.raises(ValueError, match="at least 1"):
        PracticeConfig(balls=0)
    with pytest.raises(ValueError, match=r"driven_s is 0\.0; it must be above 0"):
        PracticeConfig(driven_s=0.0)
