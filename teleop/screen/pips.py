"""How far it is: a pip for each drive, or a bar where there are too many."""

from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.palette import ACCENT, EDGE, TRACK, WORDS
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import pygame

_PIP, _STEP, _SMALLEST_STEP = 11, 16, 9


def pips(
    text: Typesetter, done: int, count: int, *, width_px: int, current: int | None = None
) -> pygame.Surface:
    """Full pips for what is done, a dot in a ring for ``current`` (from 1), rings for the rest."""
    step = min(text.px(_STEP), width_px // max(1, count))
    size = min(text.px(_PIP), max(3, round(step * _PIP / _STEP)))
    if step < text.px(_SMALLEST_STEP):
        return _bar(text, done / count, width_px)
    row = pygame.Surface((step * (count - 1) + size, size), pygame.SRCALPHA)
    for place in range(count):
        if place < done:
            pip = shapes.disc(size, WORDS)
        elif place + 1 == current:
            pip = shapes.target(size, ACCENT)
        else:
            pip = shapes.ring(size, EDGE)
        row.blit(pip, (place * step, 0))
    return row


def _bar(text: Typesetter, share: float, width_px: int) -> pygame.Surface:
    height = text.px(8)
    bar = shapes.panel((width_px, height), height // 2, TRACK).copy()
    if share > 0.0:
        filled = max(height, round(min(1.0, share) * width_px))
        bar.blit(shapes.panel((filled, height), height // 2, WORDS), (0, 0))
    return bar
