"""Keys, drawn as keys."""

from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.palette import EDGE, TRACK, WORDS
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import pygame


def keycap(text: Typesetter, key: str, size: float) -> pygame.Surface:
    """``key`` on a key's cap."""
    letters = text.line(key, size, WORDS)
    height = round(1.55 * text.px(size))
    cap_size = max(height, letters.get_width() + text.px(12)), height
    cap = shapes.panel(cap_size, text.px(5), TRACK).copy()
    cap.blit(shapes.frame(cap_size, text.px(5), EDGE, max(1, text.px(1))), (0, 0))
    cap.blit(letters, letters.get_rect(center=cap.get_rect().center))
    return cap
