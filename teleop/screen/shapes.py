"""Small shapes with smooth edges: drawn large, scaled down, and kept."""

import itertools
from collections.abc import Callable, Sequence
from functools import lru_cache
from math import cos, pi, sin

from steerlab.teleop.screen.palette import Colour
from steerlab.teleop.sdl import pygame

_FINE = 4  # each side of a pixel is drawn as this many
ARROW_STEPS = 72  # 5 degrees each

Point = tuple[float, float]


def _smooth(
    size: tuple[int, int], colour: Colour, draw: Callable[[pygame.Surface], object]
) -> pygame.Surface:
    large = pygame.Surface((size[0] * _FINE, size[1] * _FINE), pygame.SRCALPHA)
    large.fill((*colour, 0))  # of the same colour, or the edges would darken
    draw(large)
    return pygame.transform.smoothscale(large, size)


def _scaled(points: Sequence[Point], px: int) -> list[Point]:
    """Points in the unit square to a shape ``px`` wide."""
    return [(x * px * _FINE, y * px * _FINE) for x, y in points]


@lru_cache(maxsize=256)
def panel(size: tuple[int, int], radius: int, colour: Colour, alpha: int = 255) -> pygame.Surface:
    """A rectangle with round corners; do not draw on it."""
    radius = min(radius, *(side // 2 for side in size))
    return _smooth(
        size,
        colour,
        lambda large: pygame.draw.rect(
            large, (*colour, alpha), large.get_rect(), border_radius=radius * _FINE
        ),
    )


@lru_cache(maxsize=256)
def frame(size: tuple[int, int], radius: int, colour: Colour, line: int) -> pygame.Surface:
    """The outline of a rectangle with round corners."""
    return _smooth(
        size,
        colour,
        lambda large: pygame.draw.rect(
            large, colour, large.get_rect(), line * _FINE, border_radius=radius * _FINE
        ),
    )


@lru_cache(maxsize=64)
def disc(px: int, colour: Colour) -> pygame.Surface:
    """A filled circle."""
    centre = px * _FINE / 2
    return _smooth(
        (px, px),
        colour,
        lambda large: pygame.draw.circle(large, colour, (centre, centre), centre),
    )


@lru_cache(maxsize=64)
def ring(px: int, colour: Colour) -> pygame.Surface:
    """The outline of a circle."""
    centre = px * _FINE / 2
    return _smooth(
        (px, px),
        colour,
        lambda large: pygame.draw.circle(
            large, colour, (centre, centre), centre, max(_FINE, round(0.13 * px * _FINE))
        ),
    )


@lru_cache(maxsize=64)
def target(px: int, colour: Colour) -> pygame.Surface:
    """A ring around a dot."""
    shape = ring(px, colour).copy()
    dot = disc(max(2, round(0.44 * px)), colour)
    shape.blit(dot, dot.get_rect(center=shape.get_rect().center))
    return shape


@lru_cache(maxsize=16)
def tick(px: int, colour: Colour) -> pygame.Surface:
    """A check mark."""
    return _stroke(px, colour, [[(0.12, 0.54), (0.38, 0.80), (0.88, 0.22)]])


@lru_cache(maxsize=16)
def cross(px: int, colour: Colour) -> pygame.Surface:
    """Two crossed lines."""
    return _stroke(px, colour, [[(0.18, 0.18), (0.82, 0.82)], [(0.18, 0.82), (0.82, 0.18)]])


@lru_cache(maxsize=16)
def warning_sign(px: int, colour: Colour, ground: Colour) -> pygame.Surface:
    """A triangle with an exclamation mark cut out of it."""
    sign = _polygon(px, colour, [(0.5, 0.04), (1.0, 0.94), (0.0, 0.94)])
    mark = _stroke(px, ground, [[(0.5, 0.38), (0.5, 0.62)], [(0.5, 0.795), (0.5, 0.80)]], 0.10)
    sign.blit(mark, (0, 0))
    return sign


@lru_cache(maxsize=16)
def error_sign(px: int, colour: Colour, ground: Colour) -> pygame.Surface:
    """An octagon with a cross cut out of it."""
    corners = [
        (0.5 + 0.5 * cos((k + 0.5) * pi / 4), 0.5 + 0.5 * sin((k + 0.5) * pi / 4)) for k in range(8)
    ]
    sign = _polygon(px, colour, corners)
    mark = cross(round(0.56 * px), ground)
    sign.blit(mark, mark.get_rect(center=sign.get_rect().center))
    return sign


@lru_cache(maxsize=16)
def good_sign(px: int, colour: Colour, ground: Colour) -> pygame.Surface:
    """A disc with a check mark cut out of it."""
    sign = disc(px, colour).copy()
    mark = tick(round(0.62 * px), ground)
    sign.blit(mark, mark.get_rect(center=sign.get_rect().center))
    return sign


@lru_cache(maxsize=2 * ARROW_STEPS)
def arrow(px: int, colour: Colour, step: int) -> pygame.Surface:
    """An arrowhead turned left from straight up by ``step`` of ``ARROW_STEPS`` parts of a turn."""
    angle_rad = 2.0 * pi * step / ARROW_STEPS
    cosine, sine = cos(angle_rad), sin(angle_rad)
    head = ((0.0, -0.48), (0.38, 0.42), (0.0, 0.22), (-0.38, 0.42))
    return _polygon(
        px, colour, [(0.5 + cosine * x + sine * y, 0.5 - sine * x + cosine * y) for x, y in head]
    )


@lru_cache(maxsize=16)
def diamond(px: int, colour: Colour, ground: Colour) -> pygame.Surface:
    """The outline of a diamond, on ``ground``."""
    corners = [(0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5)]
    shape = _polygon(px, colour, corners)
    hole = _polygon(max(2, round(0.5 * px)), ground, corners)
    shape.blit(hole, hole.get_rect(center=shape.get_rect().center))
    return shape


def _polygon(px: int, colour: Colour, points: Sequence[Point]) -> pygame.Surface:
    return _smooth(
        (px, px), colour, lambda large: pygame.draw.polygon(large, colour, _scaled(points, px))
    )


def _stroke(
    px: int, colour: Colour, lines: Sequence[Sequence[Point]], width: float = 0.18
) -> pygame.Surface:
    def draw(large: pygame.Surface) -> None:
        pen = max(_FINE, round(width * px * _FINE))
        for points in lines:
            corners = _scaled(points, px)
            for here, there in itertools.pairwise(corners):
                pygame.draw.line(large, colour, here, there, pen)
            for corner in corners:  # round ends and joints
                pygame.draw.circle(large, colour, corner, pen / 2)

    return _smooth((px, px), colour, draw)
