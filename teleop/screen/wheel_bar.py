"""The wheel's position on a bar from full left to full right, in drives and on pages."""

from dataclasses import dataclass

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
    WORDS,
)
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.sdl import pygame

_TICKS = (-WHEEL_LIMIT, -WHEEL_LIMIT / 2, 0.0, WHEEL_LIMIT / 2, WHEEL_LIMIT)


@dataclass(frozen=True, slots=True)
class Needles:
    """What the bar shows.

    Attributes:
        own: the participant's wheel; None while it is unknown.
        agent: the robot's, where it may be seen.
        centre_band: as far from 0 as this counts as centred.
    """

    own: float | None
    agent: float | None = None
    centre_band: float | None = None


class WheelBar:
    """Draws into ``rect``; make one for each place.

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
        """What a bar needs."""
        return text.px(54)

    def x_px(self, wheel: float) -> int:
        """Where a wheel position is shown: positive is left, beyond the limits is at the limit."""
        share = min(1.0, max(-1.0, wheel / WHEEL_LIMIT))
        return round(self.track.centerx - share * self.track.width / 2)

    def draw(self, surface: pygame.Surface, needles: Needles) -> None:
        """Draw the bar, and a question mark instead of a needle that is unknown."""
        surface.blit(self._still, self.rect)
        text, track, middle = self._text, self.track, self.track.centery
        if needles.centre_band is not None:
            self._draw_band(surface, needles.centre_band)
        if needles.own is None:
            words = text.line("?", 22, WORDS)
            plate = shapes.panel((words.get_width() + text.px(14), text.px(30)), text.px(8), PANEL)
            surface.blit(plate, plate.get_rect(center=track.center))
            surface.blit(words, words.get_rect(center=(track.centerx, middle + text.px(1))))
        else:
            x = self.x_px(needles.own)
            left, right = min(x, track.centerx), max(x, track.centerx)
            surface.fill(ACCENT, (left, track.top, right - left, track.height))
            width, height = self.needle_size
            edge = text.px(2)
            outline = shapes.panel((width + 2 * edge, height + 2 * edge), width, GROUND)
            surface.blit(outline, outline.get_rect(center=(x, middle)))
            needle = shapes.panel((width, height), width // 2, WORDS)
            surface.blit(needle, needle.get_rect(center=(x, middle)))
        if needles.agent is not None:
            mark = shapes.diamond(text.px(18), GOAL, GROUND)
            surface.blit(mark, mark.get_rect(center=(self.x_px(needles.agent), middle)))
        label = self._middle_label(needles)
        surface.blit(label, label.get_rect(midbottom=(track.centerx, self.rect.bottom)))

    def _middle_label(self, needles: Needles) -> pygame.Surface:
        if needles.agent is not None:
            return self._text.line("you: bar    robot: diamond", 12, WORDS)
        if needles.centre_band is None:
            return self._text.line("0", 12, QUIET)
        if needles.own is not None and abs(needles.own) <= needles.centre_band:
            return self._text.line("centred", 12, WORDS)
        return self._text.line("centre", 12, QUIET)

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
        for words, place in (
            (f"left {WHEEL_LIMIT:g}", "left"),
            (f"{WHEEL_LIMIT:g} right", "right"),
        ):
            label = text.line(words, 12, QUIET)
            at = label.get_rect(bottom=self.rect.height)
            setattr(at, place, getattr(still.get_rect(), place))
            still.blit(label, at)
        return still
