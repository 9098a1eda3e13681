"""Text as surfaces, each drawn once: drawing it costs 0.1 ms, showing it again a hundredth."""

from collections import OrderedDict

from steerlab.teleop.screen.palette import Colour
from steerlab.teleop.sdl import pygame

_KEPT = 512
_FINE = 3  # set this much larger and scaled down: letters then stand where they should
_NONE_IS_SMALLER = 0.6875  # pygame makes its own font this much smaller than asked for


class Typesetter:
    """Sets text in pygame's own font, so that it looks the same on every machine.

    Args:
        scale: sizes are multiplied by this.
    """

    def __init__(self, scale: float) -> None:
        pygame.font.init()
        self.scale = scale
        self._fonts: dict[int, pygame.font.Font] = {}
        self._lines: OrderedDict[tuple[str, int, Colour], pygame.Surface] = OrderedDict()

    def px(self, length: float) -> int:
        """A length, scaled as the text is; at least a pixel."""
        return max(1, round(length * self.scale))

    def line(self, words: str, size: float, colour: Colour) -> pygame.Surface:
        """``words`` on one line, on a transparent surface."""
        key = (words, self.px(size), colour)
        line = self._lines.get(key)
        if line is None:
            large = self._font(key[1]).render(words, True, colour)
            width, height = large.get_width() / _FINE, large.get_height() / _FINE
            fitting = max(1, round(width)), max(1, round(height))
            line = pygame.transform.smoothscale(large, fitting)
            self._lines[key] = line
            if len(self._lines) > _KEPT:
                self._lines.popitem(last=False)
        return line

    def width(self, words: str, size: float) -> int:
        """Width of ``words`` in pixels."""
        return max(1, round(self._font(self.px(size)).size(words)[0] / _FINE))

    def shortened(self, words: str, size: float, width_px: int) -> str:
        """``words``, or as many of their letters as fit, followed by dots."""
        if self.width(words, size) <= width_px:
            return words
        while words and self.width(words + "…", size) > width_px:
            words = words[:-1].rstrip()
        return words + "…"

    def wrapped(self, words: str, size: float, width_px: int) -> list[str]:
        """``words`` on lines that fit; a word too long for a line is shortened."""
        lines: list[str] = []
        for word in words.split():
            longer = f"{lines[-1]} {word}" if lines else word
            if lines and self.width(longer, size) <= width_px:
                lines[-1] = longer
            else:
                lines.append(self.shortened(word, size, width_px))
        return lines

    def _font(self, px: int) -> pygame.font.Font:
        if px not in self._fonts:
            self._fonts[px] = pygame.font.Font(None, round(px * _FINE / _NONE_IS_SMALLER))
        return self._fonts[px]
