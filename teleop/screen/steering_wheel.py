"""A steering wheel that turns as the person's own, in a dial with left, middle and right."""

from functools import lru_cache
from math import cos, pi, sin

from steerlab.sim.language import said
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.palette import (
    ACCENT,
    EDGE,
    GOAL,
    GROUND,
    PANEL,
    PANEL_ALPHA,
    TRACK,
    WORDS,
    Colour,
)
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import pygame

LOCK_DEG = 120.0  # the picture's turn at full lock, whatever the wheel's own is
_FINE = 3
_RIM, _SPOKES, _DARK = (176, 182, 192), (122, 129, 141), (30, 34, 42)


class SteeringWheel:
    """Drawn into ``rect``, a square; each wheel position has one angle, positive to the left."""

    def __init__(self, rect: pygame.Rect, text: Typesetter) -> None:
        self.rect, self._text = rect, text
        self._dial = rect.width / 2 - text.px(10)  # radius of the scale
        self._px = round(2.0 * self._dial - text.px(20))
        self._still = self._draw_still()
        left, right = (text.line(said(side), 14, WORDS) for side in ("left", "right"))
        gap, bottom = text.px(4), rect.bottom - text.px(6)
        self._ends = (
            (left, left.get_rect(bottomright=(rect.left + gap, bottom))),
            (right, right.get_rect(bottomleft=(rect.right - gap, bottom))),
        )

    @property
    def area(self) -> pygame.Rect:
        """All that it takes, with the words at its sides."""
        return self.rect.unionall([at for _, at in self._ends])

    def mark_px(self, wheel: float) -> tuple[int, int]:
        """Where on the dial a position is shown; beyond the limits is at the limit."""
        angle = pi * turn_deg(wheel) / 180.0
        x, y = self.rect.center
        return round(x - self._dial * sin(angle)), round(y - self._dial * cos(angle))

    def draw(self, surface: pygame.Surface, needle: float | None, agent: float | None) -> None:
        """Draw the wheel, and a question mark on one whose position is unknown.

        Args:
            needle: the participant's wheel; None while it is unknown.
            agent: the robot's, where it may be seen.
        """
        text = self._text
        surface.blit(self._still, self.rect)
        for words, at in self._ends:
            surface.blit(words, at)
        wheel = _turned(
            self._px, 0 if needle is None else round(turn_deg(needle)), needle is not None
        )
        surface.blit(wheel, wheel.get_rect(center=self.rect.center))
        if needle is None:
            words = text.line("?", 40, WORDS)
            plate = shapes.disc(text.px(46), PANEL)
            surface.blit(plate, plate.get_rect(center=self.rect.center))
            surface.blit(words, words.get_rect(center=self.rect.center))
        else:
            dot = shapes.disc(text.px(16), GROUND)
            surface.blit(dot, dot.get_rect(center=self.mark_px(needle)))
            dot = shapes.disc(text.px(12), ACCENT)
            surface.blit(dot, dot.get_rect(center=self.mark_px(needle)))
        if agent is not None:
            mark = shapes.diamond(text.px(18), GOAL, GROUND)
            surface.blit(mark, mark.get_rect(center=self.mark_px(agent)))
            words = text.line(said("robot"), 14, WORDS)
            at = words.get_rect(bottomright=self._ends[0][1].topright)
            surface.blit(words, at)
            surface.blit(mark, mark.get_rect(midbottom=(at.centerx, at.top)))

    def _draw_still(self) -> pygame.Surface:
        """The dial: a scale from full left to full right."""
        side, text = self.rect.width, self._text
        still = shapes.panel((side, side), side // 2, PANEL, PANEL_ALPHA).copy()
        still.blit(_scale(side, self._dial, text.px(4)), (0, 0))
        return still


def turn_deg(wheel: float) -> float:
    """How far the picture is turned to the left."""
    return LOCK_DEG * min(1.0, max(-1.0, wheel / WHEEL_LIMIT))


@lru_cache(maxsize=4)
def _scale(side: int, radius: float, line: int) -> pygame.Surface:
    large = pygame.Surface((side * _FINE, side * _FINE), pygame.SRCALPHA)
    large.fill((*TRACK, 0))
    middle = side * _FINE / 2

    def at(degrees: float, r: float) -> tuple[float, float]:
        angle = pi * degrees / 180.0
        return middle - r * _FINE * sin(angle), middle - r * _FINE * cos(angle)

    for degree in range(round(-LOCK_DEG), round(LOCK_DEG) + 1):
        pygame.draw.circle(large, TRACK, at(degree, radius), line * _FINE / 2)
    for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
        long = 9 if share == 0.0 else 5
        colour: Colour = WORDS if share == 0.0 else EDGE
        degrees = share * LOCK_DEG
        ends = at(degrees, radius - long * line / 6), at(degrees, radius + long * line / 6)
        pygame.draw.line(large, colour, *ends, max(1, round(line * _FINE * 0.6)))
    return pygame.transform.smoothscale(large, (side, side))


@lru_cache(maxsize=2)
def _upright(px: int, known: bool) -> pygame.Surface:
    """The wheel in the middle, drawn large."""
    size = px * _FINE
    middle, rim, edge = (size / 2, size / 2), round(0.095 * size), max(1, round(0.01 * size))
    large = pygame.Surface((size, size), pygame.SRCALPHA)
    large.fill((*_SPOKES, 0))  # or the edges would darken
    pygame.draw.circle(large, _DARK, middle, size / 2)
    pygame.draw.circle(large, _RIM, middle, size / 2 - edge)
    pygame.draw.circle(large, _DARK, middle, size / 2 - rim)
    hole = pygame.Surface((size, size), pygame.SRCALPHA)
    pygame.draw.circle(hole, (255, 255, 255, 255), middle, size / 2 - rim - edge)
    large.blit(hole, (0, 0), special_flags=pygame.BLEND_RGBA_SUB)
    for x, y in ((0.07, 0.5), (0.93, 0.5), (0.5, 0.93)):
        pygame.draw.line(large, _SPOKES, middle, (x * size, y * size), round(0.10 * size))
    pygame.draw.circle(large, _SPOKES, middle, 0.15 * size)
    pygame.draw.circle(large, _DARK, middle, 0.12 * size)
    if known:
        top = pygame.Rect(0, 0, round(0.08 * size), rim + edge)
        top.midtop = round(middle[0]), 0
        pygame.draw.rect(large, ACCENT, top)
    return pygame.transform.smoothscale(large, (2 * px, 2 * px))


@lru_cache(maxsize=96)
def _turned(px: int, degrees: int, known: bool) -> pygame.Surface:
    """Kept for the degrees shown last: a person's wheel is at few of them for long."""
    return pygame.transform.rotozoom(_upright(px, known), degrees, 0.5)
