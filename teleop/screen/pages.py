"""Still pages: countdown, pause, between drives, the steps of the wheel wizard, errors."""

from collections.abc import Callable
from dataclasses import dataclass

from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.contract import Page
from steerlab.teleop.screen.palette import (
    ACCENT,
    EDGE,
    ERROR,
    GOOD,
    GROUND,
    QUIET,
    TRACK,
    WARNING,
    WORDS,
)
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import WheelBar, keycap, pips
from steerlab.teleop.sdl import pygame

_TITLE, _BIG, _LINE, _LABEL, _KEY = 32, 150, 19, 16, 16  # sizes of text
_SIGNS = {
    "good": (shapes.good_sign, GOOD),
    "warning": (shapes.warning_sign, WARNING),
    "error": (shapes.error_sign, ERROR),
}
_SMALLEST = 0.5  # text scale: a page that still does not fit runs out of the window


@dataclass(frozen=True, slots=True)
class _Part:
    """One part of a page; ``draw`` is given the rectangle it may use."""

    name: str
    height: int
    gap: int  # to the part above
    draw: Callable[[pygame.Surface, pygame.Rect], object]


class PageArtist:
    """Draws pages; text shrinks on a page that would not fit otherwise.

    Args:
        size: of the surface, width and height.
        text_scale: of the text, on top of the surface's own size.

    Attributes:
        rects: where each part of the last page was drawn.
    """

    def __init__(self, size: tuple[int, int], text_scale: float = 1.0) -> None:
        self._size, self._text_scale = size, text_scale
        self._scale = min(size[0] / 960, size[1] / 540) * text_scale
        self._setters: dict[float, Typesetter] = {}
        self.rects: dict[str, pygame.Rect] = {}

    def draw(self, surface: pygame.Surface, page: Page, ground: pygame.Surface | None) -> None:
        """Draw ``page`` on ``ground``, or on plain ground."""
        if ground is None:
            surface.fill(GROUND)
        else:
            surface.blit(ground, (0, 0))
        self.rects.clear()
        text, parts, keys = self._fitting(page)
        area = surface.get_rect()
        bottom = area.bottom
        if keys is not None:
            foot = pygame.Rect(0, 0, area.width, keys.height)
            foot.midbottom = area.centerx, area.bottom - text.px(26)
            self.rects["keys"] = foot
            keys.draw(surface, foot)
            bottom = foot.top
        free = bottom - _height(parts)
        top = max(0, free // 2)
        for part in parts:
            top += part.gap
            rect = pygame.Rect(0, top, area.width, part.height)
            self.rects[part.name] = rect
            part.draw(surface, rect)
            top = rect.bottom

    def _fitting(self, page: Page) -> tuple[Typesetter, list[_Part], _Part | None]:
        """The page's parts, and its keys, in the largest text that fits."""
        factor = 1.0
        while True:
            text = self._setters.setdefault(factor, Typesetter(self._scale * factor))
            parts = self._parts(page, text)
            keys = self._keys(page, text) if page.keys else None
            needed = _height(parts) + text.px(40)
            needed += 0 if keys is None else keys.height + text.px(26)
            if needed <= self._size[1] or factor * self._text_scale <= _SMALLEST:
                return text, parts, keys
            factor = round(factor - 0.05, 2)

    def _parts(self, page: Page, text: Typesetter) -> list[_Part]:
        parts = [self._title(page, text)]
        if page.count:
            row = pips(text, page.done, page.count, width_px=text.px(420))
            parts.append(_centred("pips", row, text.px(14)))
        if page.big:
            letters = text.line(page.big, _BIG, WORDS)
            letters = letters.subsurface(letters.get_bounding_rect())  # without its line's margins
            parts.append(_centred("big", letters, text.px(30)))
        column = min(text.px(640), round(0.88 * self._size[0]))
        gap = 30 if page.big else 22
        for number, paragraph in enumerate(page.lines):
            for row, line in enumerate(text.wrapped(paragraph, _LINE, column)):
                picture = text.line(line, _LINE, WORDS)
                parts.append(_centred(f"line {number}.{row}", picture, text.px(gap)))
                gap = 4
            gap = 12
        if page.needle is not None or page.centre_band is not None:
            parts.append(self._wheel(page, text))
        for bar_number, (name, value) in enumerate(page.bars):
            gap = text.px(24 if bar_number == 0 else 10)
            parts.append(self._bar(name, value, text, gap, f"bar {bar_number}"))
        return parts

    def _title(self, page: Page, text: Typesetter) -> _Part:
        room = round(0.92 * self._size[0])
        sign = None
        if page.tone in _SIGNS:
            make, colour = _SIGNS[page.tone]
            sign = make(text.px(34), colour, GROUND)
            room -= sign.get_width() + text.px(14)
        title = text.line(text.shortened(page.title, _TITLE, room), _TITLE, WORDS)
        return _row("title", [title] if sign is None else [sign, title], text.px(14), 0)

    def _wheel(self, page: Page, text: Typesetter) -> _Part:
        width = min(text.px(460), round(0.8 * self._size[0]))

        def draw(surface: pygame.Surface, rect: pygame.Rect) -> None:
            box = pygame.Rect(0, 0, width, rect.height)
            box.center = rect.center
            self.rects["track"] = (bar := WheelBar(box, text)).track
            bar.draw(surface, page.needle, centre_band=page.centre_band)

        return _Part("wheel", WheelBar.height_px(text), text.px(26), draw)

    def _bar(self, name: str, value: float | None, text: Typesetter, gap: int, part: str) -> _Part:
        width = min(text.px(460), round(0.8 * self._size[0]))
        height = text.px(18)

        def draw(surface: pygame.Surface, rect: pygame.Rect) -> None:
            box = pygame.Rect(0, 0, width, rect.height)
            box.center = rect.center
            label = text.line(text.shortened(name, _LABEL, width // 3), _LABEL, QUIET)
            surface.blit(label, label.get_rect(midleft=box.midleft))
            words = text.line("?" if value is None else f"{value:.0%}", _LABEL, WORDS)
            surface.blit(words, words.get_rect(midright=box.midright))
            track = pygame.Rect(0, 0, width - width // 3 - text.px(62), height)
            track.midleft = box.left + width // 3, box.centery
            radius = text.px(4)
            if value is None:
                surface.blit(shapes.frame(track.size, radius, EDGE, text.px(2)), track)
                return
            surface.blit(shapes.panel(track.size, radius, TRACK), track)
            filled = round(min(1.0, max(0.0, value)) * track.width)
            if filled:
                full = shapes.panel(track.size, radius, ACCENT)
                surface.blit(full, track, (0, 0, filled, track.height))

        return _Part(part, text.px(24), gap, draw)

    def _keys(self, page: Page, text: Typesetter) -> _Part:
        """The part with the key hints, on one row if they fit, else a row each."""
        pairs = [(keycap(text, key, _KEY), text.line(does, _KEY, QUIET)) for key, does in page.keys]
        between, after = text.px(8), text.px(30)
        widths = [cap.get_width() + between + does.get_width() for cap, does in pairs]
        across = sum(widths) + after * (len(pairs) - 1) <= 0.95 * self._size[0]
        cap_height = max(cap.get_height() for cap, _ in pairs)
        step = cap_height + text.px(6)

        def draw(surface: pygame.Surface, rect: pygame.Rect) -> None:
            left = rect.centerx - (sum(widths) + after * (len(pairs) - 1)) // 2
            column = rect.centerx - max(widths) // 2
            for number, ((cap, does), width) in enumerate(zip(pairs, widths, strict=True)):
                x = left if across else column
                y = rect.top if across else rect.top + number * step
                surface.blit(cap, (x, y))
                at = x + cap.get_width() + between, y + cap_height // 2
                surface.blit(does, does.get_rect(midleft=at))
                left += width + after

        height = cap_height if across else step * len(pairs) - text.px(6)
        return _Part("keys", height, 0, draw)


def _height(parts: list[_Part]) -> int:
    return sum(part.gap + part.height for part in parts)


def _centred(name: str, picture: pygame.Surface, gap: int) -> _Part:
    return _row(name, [picture], 0, gap)


def _row(name: str, pictures: list[pygame.Surface], between: int, gap: int) -> _Part:
    """A part with pictures side by side, centred."""
    height = max(picture.get_height() for picture in pictures)
    width = sum(picture.get_width() + between for picture in pictures) - between

    def draw(surface: pygame.Surface, rect: pygame.Rect) -> None:
        left = rect.centerx - width // 2
        for picture in pictures:
            surface.blit(picture, picture.get_rect(midleft=(left, rect.centery)))
            left += picture.get_width() + between

    return _Part(name, height, gap, draw)
