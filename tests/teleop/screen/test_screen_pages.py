from itertools import combinations

import numpy as np
import pytest

from steerlab.teleop.screen.contract import Page
from steerlab.teleop.screen.pages import PageArtist
from steerlab.teleop.screen.palette import ACCENT, GROUND, WORDS
from steerlab.teleop.sdl import pygame

FULL = Page(
    title="Press each pedal down fully, twice, and let it come back",
    big="3",
    lines=("Hold it there for a moment, then let it come back to the middle. " * 2, "Step 2 of 5"),
    keys=(("Space", "next"), ("R", "do this step again"), ("Esc", "cancel; nothing is kept")),
    tone="warning",
    needle=1.7,
    centre_band=0.15,
    bars=(("Throttle", 0.5), ("Brake", None), ("Clutch", 0.0)),
    done=1,
    count=5,
)


def _draw(page, size=(960, 540), text_scale=1.0, ground=None):
    surface = pygame.Surface(size)
    surface.fill((255, 0, 255))
    artist = PageArtist(size, text_scale)
    artist.draw(surface, page, ground)
    return surface, artist


@pytest.mark.parametrize("size", [(640, 360), (960, 540), (1280, 720), (1024, 768)])
@pytest.mark.parametrize("text_scale", [0.8, 1.0, 1.6, 2.0])
def test_everything_fits_and_nothing_overlaps(size, text_scale):
    surface, artist = _draw(FULL, size, text_scale)
    rects = {name: rect for name, rect in artist.rects.items() if name != "track"}
    assert {"title", "pips", "big", "line 0.0", "wheel", "bar 0", "bar 2", "keys"} <= set(rects)
    for name, rect in rects.items():
        assert surface.get_rect().contains(rect), name
    for (one, here), (other, there) in combinations(rects.items(), 2):
        assert not here.colliderect(there), (one, other)


def test_text_is_larger_where_it_was_asked_for():
    page = Page(title="Pause", lines=("You paused the drive.",))
    heights = [_draw(page, text_scale=scale)[1].rects["title"].height for scale in (0.8, 1.0, 2.0)]
    assert heights[0] < heights[1] < heights[2]


def test_what_is_said(words):
    _draw(FULL)
    assert {FULL.title, "3", "Throttle", "50%", "?", "Space", "next", "Esc"} <= set(words)
    assert "Step 2 of 5" in words


@pytest.mark.parametrize(
    ("needle", "said"), [(0.0, "centred"), (-0.15, "centred"), (0.2, "centre"), (None, "?")]
)
def test_centred_is_said(words, needle, said):
    _draw(Page(title="Drive 1 of 12", needle=needle, centre_band=0.15))
    assert said in words
    if said != "centred":
        assert "centred" not in words


def test_the_centre_band_is_as_wide_as_what_counts_as_centred(pixels):
    wide, narrow = (
        _draw(Page(title="Drive", needle=-2.0, centre_band=band))[0] for band in (1.0, 0.1)
    )
    _, artist = _draw(Page(title="Drive", needle=-2.0, centre_band=1.0))
    track = artist.rects["track"]
    row = pixels(wide)[track.top - 6, track.left : track.centerx - 8]
    edge = np.nonzero((row != GROUND).any(axis=-1))[0].mean() + track.left
    assert edge == pytest.approx(track.centerx - track.width / 5, abs=10)
    assert (pixels(wide) != pixels(narrow)).any()


def test_a_page_without_a_wheel_shows_none(words):
    _, artist = _draw(Page(title="Pause"))
    assert "wheel" not in artist.rects
    assert "?" not in words


@pytest.mark.parametrize(("value", "share"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.3, 1.0)])
def test_a_bar_is_filled_as_far_as_its_value(pixels, value, share):
    full, artist = _draw(Page(title="Pedals", bars=(("Throttle", 1.0),)))
    here, _ = _draw(Page(title="Pedals", bars=(("Throttle", value),)))
    row = artist.rects["bar 0"].centery
    filled = (pixels(here)[row] == ACCENT).all(axis=-1).sum()
    whole = (pixels(full)[row] == ACCENT).all(axis=-1).sum()
    assert filled == pytest.approx(share * whole, abs=2)


def test_an_unknown_bar_is_not_an_empty_one(grey):
    unknown, _ = _draw(Page(title="Pedals", bars=(("Throttle", None),)))
    empty, _ = _draw(Page(title="Pedals", bars=(("Throttle", 0.0),)))
    assert (abs(grey(unknown) - grey(empty)) > 30).sum() > 100


def test_tones_differ_without_colours(grey):
    tones = ("neutral", "good", "warning", "error")
    images = [grey(_draw(Page(title="Pause", tone=tone))[0]) for tone in tones]
    for one, other in combinations(images, 2):
        assert (abs(one - other) > 60).sum() > 40


def test_over_the_drive_or_on_plain_ground(pixels):
    ground = pygame.Surface((960, 540))
    ground.fill((10, 200, 30))
    page = Page(title="Drive 3 of 12", big="3")
    for picture, colour in ((ground, (10, 200, 30)), (None, GROUND)):
        surface, artist = _draw(page, ground=picture)
        image, big = pixels(surface), artist.rects["big"]
        assert tuple(image[0, 0]) == tuple(image[-1, -1]) == colour
        letters = abs(image[big.top : big.bottom] - WORDS) <= 8
        assert letters.all(axis=-1).sum() > 500
