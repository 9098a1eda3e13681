from itertools import combinations, pairwise
from math import atan2, degrees, pi

import numpy as np
import pytest

from steerlab.sim.camera_config import viewpoints
from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import CarConfig
from steerlab.teleop.screen import hud as hud_module
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.hud import Hud
from steerlab.teleop.screen.palette import ACCENT, GOAL, WORDS
from steerlab.teleop.screen.steering_wheel import LOCK_DEG
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import pips
from steerlab.teleop.sdl import pygame

BALL = (30.0, 0.0)
MAGENTA = (255, 0, 255)  # what ``blank`` is filled with
SIZES = [(640, 360), (960, 540), (1280, 720), (1920, 1080), (1024, 768)]
LONG = "Thrustmaster TMX Force Feedback Racing Wheel"


def _turn_deg(image, colour, dial):
    """How far to the left of straight up the middle of a colour is, around the dial's middle."""
    part = image[dial.top : dial.bottom, dial.left : dial.right]
    rows, columns = np.nonzero((part == colour).all(axis=-1))
    assert rows.size
    half = dial.width / 2
    return degrees(atan2(half - columns.mean(), half - rows.mean()))


@pytest.mark.parametrize("wheel", [2.5, 1.0, 0.4, 0.0, -0.4, -1.7, -2.5])
def test_the_wheel_turns_as_ones_own_and_left_is_positive(view, blank, pixels, wheel):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(needle=wheel), BALL)
    turned = _turn_deg(pixels(surface), ACCENT, hud.wheel.rect)
    assert turned == pytest.approx(LOCK_DEG * wheel / 2.5, abs=1.5)


def test_the_whole_wheel_turns_and_not_its_mark_alone(view, blank, pixels):
    images = []
    for wheel in (0.0, 1.25):
        surface, hud = blank(), Hud((960, 540))
        hud.draw(surface, view(needle=wheel), BALL)
        images.append(pixels(surface))
    spoke = hud.wheel.rect.center[0], hud.wheel.rect.center[1] + hud.wheel.rect.height // 5
    assert (images[0][spoke[::-1]] != images[1][spoke[::-1]]).any()


def test_a_wheel_beyond_the_limits_is_shown_at_the_limit(view, blank, pixels):
    beyond, at_limit, hud = blank(), blank(), Hud((960, 540))
    hud.draw(beyond, view(needle=7.0), BALL)
    hud.draw(at_limit, view(needle=2.5), BALL)
    np.testing.assert_array_equal(pixels(beyond), pixels(at_limit))


def test_an_unknown_wheel_is_a_question_mark_and_has_no_mark(view, blank, pixels, words):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(needle=None), BALL)
    assert "?" in words
    image, dial = pixels(surface), hud.wheel.rect
    assert not (image[dial.top : dial.bottom, dial.left : dial.right] == ACCENT).all(axis=-1).any()
    words.clear()
    centred = blank()
    hud.draw(centred, view(needle=0.0), BALL)
    assert "?" not in words
    assert (pixels(centred) != image).any()


def test_no_number_says_how_far_the_wheel_is_turned(view, blank, words):
    Hud((960, 540)).draw(blank(), view(needle=1.0, agent_needle=-1.0), BALL)
    assert {"left", "right", "robot"} <= set(words)
    assert not [word for word in words if "2.5" in word]


def test_the_robots_wheel_is_shown_only_where_it_is_given(view, blank, pixels):
    hud = Hud((960, 540))
    for agent, seen in ((None, False), (1.5, True)):
        surface = blank()
        hud.draw(surface, view(needle=-1.0, agent_needle=agent), BALL)
        image, dial = pixels(surface), hud.wheel.rect
        part = image[dial.top : dial.bottom, dial.left : dial.right]
        assert (part == GOAL).all(axis=-1).any() == seen
        if seen:
            assert _turn_deg(image, GOAL, dial) == pytest.approx(LOCK_DEG * 1.5 / 2.5, abs=3)


def test_a_goal_behind_a_block_is_ringed_where_it_is(view, blank, pixels):
    """The instruments know no blocks: the ring is drawn over whatever stands before the ball."""
    surface, hud = blank(), Hud((960, 540), view="driver")
    ball = (40.0, 8.0)
    hud.draw(surface, view(), ball)
    ring = hud.rects["marker"]
    at = viewpoints(CarConfig())["driver"].seen(view().pose, (*ball, 2.0), (960, 540))
    assert ring.center == pytest.approx((at.x_px, at.y_px), abs=2)
    image = pixels(surface)[ring.top : ring.bottom, ring.left : ring.right]
    assert (image == GOAL).all(axis=-1).sum() > 40
    assert (image[ring.height // 2, ring.width // 2] == MAGENTA).all()  # one sees through it


@pytest.mark.parametrize(
    ("heading_rad", "side"), [(pi / 2, "right"), (-pi / 2, "left"), (3.0, "right"), (-3.0, "left")]
)
def test_a_goal_out_of_view_has_an_arrow_at_the_edge(view, blank, pixels, heading_rad, side):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(pose=Pose2D(0.0, 0.0, heading_rad)), BALL)
    arrow = hud.rects["marker"]
    assert arrow.right < 100 if side == "left" else arrow.left > 860
    part = pixels(surface)[arrow.top : arrow.bottom, arrow.left : arrow.right]
    columns = np.nonzero((part == GOAL).all(axis=-1).any(axis=0))[0]
    tall = [(part[:, column] == GOAL).all(axis=-1).sum() for column in (columns[2], columns[-3])]
    assert (tall[0] < tall[1]) == (side == "left")  # the tip is narrow


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        (Outcome.BALL_REACHED, "Ball reached"),
        (Outcome.BLOCK_HIT, "Contact"),
        (Outcome.OUT_OF_BOUNDS, "Off the ground"),
        (Outcome.TIME_LIMIT, "Time is up"),
    ],
)
def test_how_a_drive_ended_is_said_and_flashed(view, blank, pixels, words, outcome, said):
    surface, hud = blank(), Hud((960, 540))
    hud.draw(surface, view(), BALL)
    assert said not in words
    assert (pixels(surface)[0, 0] == MAGENTA).all()
    hud.draw(surface, view(outcome=outcome), BALL)
    assert said in words
    edges = pixels(surface)[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (edges == edges[0]).all()
    assert (edges[0] != MAGENTA).any()


@pytest.mark.parametrize(("speed_mps", "said"), [(0.0, "0"), (5.0, "18"), (-1.0, "4")])
def test_the_speed(view, blank, words, speed_mps, said):
    Hud((960, 540)).draw(blank(), view(speed_mps=speed_mps), BALL)
    assert {said, "km/h"} <= set(words)


@pytest.mark.parametrize(
    ("heading_rad", "step", "metres"),
    [(0.0, 0, "30 m"), (-pi / 2, 18, "30 m"), (pi / 2, 54, "30 m"), (pi, 36, "30 m")],
)
def test_the_arrow_points_to_the_ball(view, blank, monkeypatch, words, heading_rad, step, metres):
    steps = []
    arrow = shapes.arrow
    monkeypatch.setattr(shapes, "arrow", lambda *args: steps.append(args[2]) or arrow(*args))
    Hud((960, 540)).draw(blank(), view(pose=Pose2D(0.0, 0.0, heading_rad)), BALL)
    assert steps[-1] == step
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
@pytest.mark.parametrize("perspective", ["driver", "front", "chase"])
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
    assert len(hud.rects) == 9
    marker = hud.rects.pop("marker")  # over the ball, wherever that is
    assert surface.get_rect().contains(marker)
    third = size[1] / 3
    for name, rect in hud.rects.items():
        assert surface.get_rect().contains(rect), name
    for (one, here), (other, there) in combinations(hud.rects.items(), 2):
        assert not here.colliderect(there), (one, other)
    middle = pixels(surface)[int(third) : int(2 * third)]
    assert (middle[:, size[0] // 3 : 2 * size[0] // 3] == MAGENTA).all()


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
