"""What drives and pages share: progress pips, key caps and the bar of the wheel's position."""

from steerlab.sim.language import said
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.palette import (
    ACCENT,
    EDGE,
    GOAL,
    GROUND,
    PANEL,
    QUIET,
    TRACK,
    WARNING,
    WORDS,
)
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import pygame

_PIP, _STEP, _SMALLEST_STEP = 11, 16, 9
_TICKS = (-WHEEL_LIMIT, -WHEEL_LIMIT / 2, 0.0, WHEEL_LIMIT / 2, WHEEL_LIMIT)


def pips(
    text: Typesetter, done: int, count: int, *, width_px: int, current: int | None = None
) -> pygame.Surface:
    """Full pips for what is done, a dot in a ring for ``current`` (from 1), rings for the rest."""
    step = min(text.px(_STEP), width_px // max(1, count))
    size = min(text.px(_PIP), max(3, round(step * _PIP / _STEP)))
    if step < text.px(_SMALLEST_STEP):
        return _progress_bar(text, done / count, width_px)
    row = pygame.Surface((step * (count - 1) + size, size), pygame.SRCALPHA)
    for index in range(count):
        if index < done:
            pip = shapes.disc(size, WORDS)
        elif index + 1 == current:
            pip = shapes.target(size, ACCENT)
        else:
            pip = shapes.ring(size, EDGE)
        row.blit(pip, (index * step, 0))
    return row


def _progress_bar(text: Typesetter, share: float, width_px: int) -> pygame.Surface:
    height = text.px(8)
    bar = shapes.panel((width_px, height), height // 2, TRACK).copy()
    if share > 0.0:
        filled = max(height, round(min(1.0, share) * width_px))
        bar.blit(shapes.panel((filled, height), height // 2, WORDS), (0, 0))
    return bar


def keycap(text: Typesetter, key: str, size: float) -> pygame.Surface:
    """``key`` on a key's cap."""
    letters = text.line(key, size, WORDS)
    height = round(1.55 * text.px(size))
    cap_size = max(height, letters.get_width() + text.px(12)), height
    cap = shapes.panel(cap_size, text.px(5), TRACK).copy()
    cap.blit(shapes.frame(cap_size, text.px(5), EDGE, max(1, text.px(1))), (0, 0))
    cap.blit(letters, letters.get_rect(center=cap.get_rect().center))
    return cap


def notice(text: Typesetter, words: str) -> pygame.Surface:
    """A question or a warning that lies over everything else for a moment."""
    line, sign = text.line(words, 20, WORDS), shapes.warning_sign(text.px(26), WARNING, PANEL)
    pad, gap = text.px(14), text.px(10)
    size = (
        line.get_width() + sign.get_width() + 2 * pad + gap,
        max(line.get_height(), sign.get_height()) + 2 * text.px(9),
    )
    made = shapes.panel(size, text.px(10), PANEL).copy()
    made.blit(shapes.frame(size, text.px(10), WARNING, text.px(2)), (0, 0))
    made.blit(sign, sign.get_rect(midleft=(pad, size[1] // 2)))
    made.blit(line, line.get_rect(midright=(size[0] - pad, size[1] // 2)))
    return made


class WheelBar:
    """The wheel's position on a bar from full left to full right, drawn into ``rect``.

    Args:
        rect: its height is ``height_px``.
    """

    def __init__(self, rect: pygame.Rect, text: Typesetter) -> None:
        self.rect, self._text = rect, text
        room = text.px(14)  # for half a needle at either end
        self.track = pygame.Rect(
            rect.left + room, rect.top + text.px(15), rect.width - 2 * room, text.px(8)
        )
        self.needle_size = text.px(6), text.px(30)
        self._still = self._draw_still()
        self._band: tuple[float, pygame.Surface] | None = None

    @staticmethod
    def height_px(text: Typesetter) -> int:
        """Height that a bar needs."""
        return text.px(54)

    def x_px(self, wheel: float) -> int:
        """Where a wheel position is shown: positive is left, beyond the limits is at the limit."""
        share = min(1.0, max(-1.0, wheel / WHEEL_LIMIT))
        return round(self.track.centerx - share * self.track.width / 2)

    def draw(
        self,
        surface: pygame.Surface,
        needle: float | None,
        *,
        agent: float | None = None,
        centre_band: float | None = None,
    ) -> None:
        """Draw the bar, and a question mark instead of a needle that is unknown.

        Args:
            needle: the participant's wheel; None while it is unknown.
            agent: the robot's, where it may be seen.
            centre_band: as far from 0 as this counts as centred.
        """
        surface.blit(self._still, self.rect)
        text, track, middle = self._text, self.track, self.track.centery
        if centre_band is not None:
            self._draw_band(surface, centre_band)
        if needle is None:
            words = text.line("?", 22, WORDS)
            plate = shapes.panel((words.get_width() + text.px(14), text.px(30)), text.px(8), PANEL)
            surface.blit(plate, plate.get_rect(center=track.center))
            surface.blit(words, words.get_rect(center=(track.centerx, middle + text.px(1))))
        else:
            x = self.x_px(needle)
            left, right = min(x, track.centerx), max(x, track.centerx)
            surface.fill(ACCENT, (left, track.top, right - left, track.height))
            width, height = self.needle_size
            edge = text.px(2)
            outline = shapes.panel((width + 2 * edge, height + 2 * edge), width, GROUND)
            surface.blit(outline, outline.get_rect(center=(x, middle)))
            bar = shapes.panel((width, height), width // 2, WORDS)
            surface.blit(bar, bar.get_rect(center=(x, middle)))
        if agent is not None:
            mark = shapes.diamond(text.px(18), GOAL, GROUND)
            surface.blit(mark, mark.get_rect(center=(self.x_px(agent), middle)))
        label = self._middle_label(needle, agent, centre_band)
        surface.blit(label, label.get_rect(midbottom=(track.centerx, self.rect.bottom)))

    def _middle_label(
        self, needle: float | None, agent: float | None, centre_band: float | None
    ) -> pygame.Surface:
        if agent is not None:
            return self._text.line(said("you: bar    robot: diamond"), 12, WORDS)
        if centre_band is not None and needle is not None and abs(needle) <= centre_band:
            return self._text.line(said("centred"), 12, WORDS)
        return self._text.line(said("centre"), 12, QUIET)

    def _draw_band(self, surface: pygame.Surface, half_width: float) -> None:
        if self._band is None or self._band[0] != half_width:
            text = self._text
            width = self.x_px(-half_width) - self.x_px(half_width) + self.needle_size[0]
            size = (width + 2 * text.px(4), self.needle_size[1] + 2 * text.px(3))
            self._band = half_width, shapes.frame(size, text.px(6), QUIET, text.px(2))
        band = self._band[1]
        surface.blit(band, band.get_rect(center=self.track.center))

    def _draw_still(self) -> pygame.Surface:
        still = pygame.Surface(self.rect.size, pygame.SRCALPHA)
        text = self._text
        track = self.track.move(-self.rect.left, -self.rect.top)
        still.blit(shapes.panel(track.size, track.height // 2, TRACK), track)
        for wheel in _TICKS:
            long = wheel == 0.0
            mark = pygame.Rect(0, 0, text.px(2), text.px(22 if long else 12))
            mark.center = self.x_px(wheel) - self.rect.left, track.centery
            still.fill(WORDS if long else EDGE, mark)
        for side in ("left", "right"):
            label = text.line(said(side), 12, QUIET)
            at = label.get_rect(bottom=self.rect.height)
            setattr(at, side, getattr(still.get_rect(), side))
            still.blit(label, at)
        return still
