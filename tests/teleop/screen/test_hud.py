from itertools import combinations, pairwise
from math import pi

import numpy as np
import pytest

from steerlab.sim.geometry import Pose2D
from steerlab.teleop.screen import hud as hud_module
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.hud import Hud
from steerlab.teleop.screen.palette import ACCENT, GOAL, WORDS
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import pips
from steerlab.teleop.sdl import pygame

BALL = (30.0, 0.0)
SIZES = [(640, 360), (960, 540), (1280, 720), (1920, 1080), (1024, 768)]
LONG = "Thrustmaster TMX Force Feedback Racing Wheel"


def _columns(image, colour, rect):
    part = image[rect.top : rect.bottom, rect.left : rect.right]
    return np.nonzero((part == colour).all(axis=-1).any(axis=0))[0] + rect.left


def _above(track):
    """A strip that a needle reaches into, and nothing else of the bar but its middle tick."""
    return pygame.Rect(track.left - 10, track.top - 9, track.width + 20, 2)


@pytest.mark.parametrize("wheel", [2.5, 1.0, 0.4, -0.4, -1.7, -2.5])
def test_the_needle_stands_where_the_wheel_is_and_left_is_positive(view, blank, pixels, wheel):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(needle=wheel), BALL)
    image, track = pixels(surface), hud.track
    columns = _columns(image, WORDS, _above(track))
    needle = columns[abs(columns - track.centerx) > 6]
    expected = track.centerx - wheel / 2.5 * track.width / 2
    assert needle.mean() == pytest.approx(expected, abs=1.5)
    accent = _columns(image, ACCENT, track)
    assert (accent.mean() < track.centerx) == (wheel > 0)


def test_a_needle_beyond_the_limits_stands_at_the_limit(view, blank, pixels):
    beyond, at_limit, hud = blank(), blank(), Hud((960, 540))
    hud.draw(beyond, view(needle=7.0), BALL)
    hud.draw(at_limit, view(needle=2.5), BALL)
    np.testing.assert_array_equal(pixels(beyond), pixels(at_limit))


def test_an_unknown_wheel_is_a_question_mark_and_no_needle(view, blank, pixels, words):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(needle=None), BALL)
    assert "?" in words
    image = pixels(surface)
    assert not _columns(image, ACCENT, hud.track).size
    strip = _columns(image, WORDS, _above(hud.track))
    assert not strip[abs(strip - hud.track.centerx) > 20].size
    words.clear()
    centred = blank()
    hud.draw(centred, view(needle=0.0), BALL)
    assert "?" not in words
    assert (pixels(centred) != image).any()


def test_the_robots_wheel_is_shown_only_where_it_is_given(view, blank, pixels):
    hud = Hud((960, 540))
    for agent, seen in ((None, False), (1.5, True)):
        surface = blank()
        hud.draw(surface, view(needle=-1.0, agent_needle=agent), BALL)
        columns = _columns(pixels(surface), GOAL, hud.rects["wheel"])
        assert bool(columns.size) == seen
        if seen:
            assert columns.mean() == pytest.approx(hud.x_px(1.5), abs=1)


@pytest.mark.parametrize(
    ("heading_rad", "step", "metres"),
    [(0.0, 0, "30 m"), (-pi / 2, 18, "30 m"), (pi / 2, 54, "30 m"), (pi, 36, "30 m")],
)
def test_the_arrow_points_to_the_ball(view, blank, monkeypatch, words, heading_rad, step, metres):
    steps = []
    arrow = shapes.arrow
    monkeypatch.setattr(shapes, "arrow", lambda *args: steps.append(args[2]) or arrow(*args))
    Hud((960, 540)).draw(blank(), view(pose=Pose2D(0.0, 0.0, heading_rad)), BALL)
    assert steps == [step]
    assert metres in words


def test_arrows_turn_to_the_left_with_their_step(pixels):
    ahead = shapes.arrow(40, GOAL, 0)
    alpha = pygame.surfarray.array_alpha(ahead).T.astype(int)
    assert np.nonzero(alpha[4] > 99)[0].mean() == pytest.approx(19.5, abs=0.6)  # the tip, above
    assert len(np.nonzero(alpha[4] > 99)[0]) < len(np.nonzero(alpha[30] > 99)[0])
    left = pygame.surfarray.array_alpha(shapes.arrow(40, GOAL, 18)).T.astype(int)
    turned = pygame.surfarray.array_alpha(pygame.transform.rotate(ahead, 90)).T.astype(int)
    assert abs(left - turned).mean() < 8


def test_the_metres_follow_the_car(view, blank, words):
    hud = Hud((960, 540))
    hud.draw(blank(), view(pose=Pose2D(0.0, 0.0, 0.0)), (3.0, 4.0))
    hud.draw(blank(), view(pose=Pose2D(-100.0, 0.0, 0.0)), (20.4, 0.0))
    assert [word for word in words if word.endswith(" m")] == ["5 m", "120 m"]


def test_what_is_said(view, blank, words):
    hud = Hud((960, 540))
    hud.draw(blank(), view(elapsed_s=72.9), BALL)
    assert {"Rollout 3 of 12", "REC", "1:12", "G29 OK", "pause", "redo", "stop"} <= set(words)
    assert "Steer as you think the car should have steered." in words
    assert "You drive" not in words
    words.clear()
    hud.draw(
        blank(),
        view(recording=False, device_ok=False, teacher_drives=True, balls=2, count=5, number=3),
        BALL,
    )
    assert {"Practice", "2 of 5 balls", "not recorded", "not heard: G29", "You drive"} <= set(words)
    assert "REC" not in words


@pytest.mark.parametrize(
    ("changes", "shown"),
    [({"number": 3}, (2, 12, 3)), ({"balls": 2, "count": 5}, (2, 5, None))],
)
def test_drives_before_this_one_are_done(view, blank, monkeypatch, changes, shown):
    asked = []

    def listening(text, done, count, *, width_px, current=None):
        asked.append((done, count, current))
        return pips(text, done, count, width_px=width_px, current=current)

    monkeypatch.setattr(hud_module, "pips", listening)
    Hud((960, 540)).draw(blank(), view(**changes), BALL)
    assert asked == [shown]


def test_a_device_with_a_long_name_still_says_ok(view, blank, words):
    hud = Hud((960, 540), 1.6)
    hud.draw(blank(), view(device=LONG), BALL)
    said = next(word for word in words if word.endswith("OK"))
    assert said.startswith("Thrust")
    assert "…" in said


def test_unchanged_text_is_not_set_again(view, blank, monkeypatch):
    hud, surface = Hud((960, 540)), blank()
    hud.draw(surface, view(needle=0.5), BALL)
    set_again = []
    font = Typesetter._font
    monkeypatch.setattr(
        Typesetter, "_font", lambda self, px: set_again.append(px) or font(self, px)
    )
    moved = Pose2D(0.1, 0.0, 0.01)
    hud.draw(surface, view(needle=-2.0, pose=moved, elapsed_s=12.9), BALL)
    assert not set_again
    hud.draw(surface, view(elapsed_s=13.0), BALL)
    assert set_again


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("text_scale", [0.8, 1.0, 1.6, 2.0])
@pytest.mark.parametrize("perspective", ["front", "chase"])
def test_the_middle_stays_clear_and_nothing_overlaps(
    view, blank, pixels, size, text_scale, perspective
):
    surface = blank(size)
    hud = Hud(size, text_scale, perspective)
    hud.draw(
        surface,
        view(device=LONG, teacher_drives=True, agent_needle=1.0, elapsed_s=754.0),
        (200.0, 150.0),
    )
    assert len(hud.rects) == 7
    third = size[1] / 3
    for name, rect in hud.rects.items():
        assert surface.get_rect().contains(rect), name
    for (one, here), (other, there) in combinations(hud.rects.items(), 2):
        assert not here.colliderect(there), (one, other)
    middle = pixels(surface)[int(third) : int(2 * third)]
    assert (middle[:, size[0] // 3 : 2 * size[0] // 3] == (255, 0, 255)).all()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"recording": True}, {"recording": False}),
        ({"device_ok": True}, {"device_ok": False}),
        ({"number": 3}, {"number": 4}),
        ({"balls": 2}, {"balls": 3}),
        ({"teacher_drives": True}, {"teacher_drives": False}),
        ({"needle": 1.0}, {"needle": -1.0}),
        ({"needle": 0.0}, {"needle": None}),
        ({"agent_needle": 1.0, "needle": 1.0}, {"agent_needle": None, "needle": 1.0}),
    ],
)
def test_without_colours_states_still_differ(view, blank, grey, one, other):
    images = []
    for changes in (one, other):
        surface, hud = blank(), Hud((960, 540))
        hud.draw(surface, view(**changes), BALL)
        images.append(grey(surface))
    assert (abs(images[0] - images[1]) > 60).sum() > 25


def test_pips_change_one_by_one():
    text = Typesetter(1.0)
    rows = [pips(text, done, 12, width_px=300) for done in range(13)]
    cell = rows[0].get_width() / 12
    alphas = [pygame.surfarray.array_alpha(row).astype(int) for row in rows]
    for done, (before, after) in enumerate(pairwise(alphas)):
        columns = np.nonzero((before != after).any(axis=1))[0]
        assert columns.size
        assert done * cell - 2 < columns.min() <= columns.max() < (done + 1) * cell + 2
        assert after.sum() > before.sum()


def test_the_current_pip_is_neither_done_nor_to_come():
    text = Typesetter(1.0)
    images = [
        pygame.surfarray.array_alpha(pips(text, done, 3, width_px=99, current=current)).astype(int)
        for done, current in ((1, None), (1, 2), (2, None))
    ]
    for one, other in combinations(images, 2):
        assert (abs(one - other) > 60).sum() > 5


def test_very_many_drives_are_a_bar(pixels):
    text = Typesetter(1.0)
    rows = [pips(text, done, 200, width_px=300) for done in (0, 100, 200)]
    assert {row.get_width() for row in rows} == {300}
    filled = [(pixels(row)[row.get_height() // 2] == WORDS).all(axis=-1).sum() for row in rows]
    assert filled[0] == 0
    assert filled[1] == pytest.approx(150, abs=5)
    assert filled[2] > 290
