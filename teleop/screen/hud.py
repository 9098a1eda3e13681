"""The instruments over a drive, in the upper and lower thirds: the middle stays clear.

But for the goal's marker: a ring where the ball is, also behind a block, or an arrow at the edge to
whose side it lies. It says where the goal is, which the arrow and the metres say anyway, and nothing of
the way there: no line, no path, no turn is ever shown.
"""

from collections.abc import Callable
from functools import lru_cache
from math import hypot, pi

from steerlab.sim.camera_config import View, viewpoints
from steerlab.sim.geometry import bearing_rad
from steerlab.sim.language import said
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.contract import DriveView
from steerlab.teleop.screen.palette import (
    ACCENT,
    ERROR,
    GOAL,
    GOOD,
    GROUND,
    PANEL,
    PANEL_ALPHA,
    QUIET,
    WORDS,
    Colour,
)
from steerlab.teleop.screen.steering_wheel import SteeringWheel
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import keycap, pips
from steerlab.teleop.sdl import pygame

_KEYS = (("P", "pause"), ("R", "redo"), ("Esc", "stop"))
_HEAD, _TEXT, _LINE, _DIGITS = 17, 14, 17, 22  # sizes of text
_SMALLEST_LINE = 10
_RING_STEP = 4  # px: rings are drawn once for each size
_ENDS: dict[Outcome, tuple[str, Colour, Callable[..., pygame.Surface]]] = {
    Outcome.BALL_REACHED: ("Ball reached", GOOD, shapes.good_sign),
    Outcome.BLOCK_HIT: ("Contact", ERROR, shapes.error_sign),
    Outcome.OUT_OF_BOUNDS: ("Off the ground", ERROR, shapes.error_sign),
    Outcome.TIME_LIMIT: ("Time is up", QUIET, shapes.warning_sign),
}


class Hud:
    """Draws a ``DriveView``'s instruments; each part is made again only when it changes.

    Args:
        size: of the surface, width and height.
        text_scale: of the text, on top of the surface's own size.
        view: where the camera is, and so where the ball is seen.

    Attributes:
        rects: where each part was drawn last.
    """

    def __init__(
        self, size: tuple[int, int], text_scale: float = 1.0, view: View = "front"
    ) -> None:
        unit = min(size[0] / 960, size[1] / 540)
        self._size, self._viewpoint = size, viewpoints(CarConfig())[view]
        self._text = Typesetter(unit * text_scale)
        self._space = Typesetter(unit)  # margins do not grow with the text
        margin = self._space.px(14)
        self._area = pygame.Rect((0, 0), size).inflate(-2 * margin, -2 * margin)
        self._room_px = self._area.width // 3 - self._space.px(36)  # inside an upper panel
        self._parts: dict[str, tuple[tuple[object, ...], pygame.Surface]] = {}
        self.rects: dict[str, pygame.Rect] = {}
        side = self._space.px(158)
        dial = pygame.Rect(0, 0, side, side)
        dial.midbottom = self._area.centerx, size[1] - self._space.px(8)
        self.wheel = SteeringWheel(dial, self._space)

    def draw(
        self, surface: pygame.Surface, view: DriveView, ball_xy_m: tuple[float, float]
    ) -> None:
        """Draw everything on the picture of the world."""
        self.rects.clear()
        area = self._area
        self._mark_goal(surface, view, ball_xy_m)
        key = (view.number, view.count, view.balls)
        self._put(surface, "progress", "topleft", area.topleft, key, self._progress)
        key = _goal_key(view, ball_xy_m)
        self._put(surface, "goal", "midtop", area.midtop, key, self._goal)
        key = (view.recording, int(view.elapsed_s), view.device, view.device_ok)
        self._put(surface, "status", "topright", area.topright, key, self._status)
        if view.instruction:
            key = (said(view.instruction), area.width)
            below = max(self.rects[name].bottom for name in ("progress", "goal", "status"))
            at = area.centerx, below + self._space.px(6)
            self._put(surface, "instruction", "midtop", at, key, self._instruction)
        self._put(surface, "keys", "bottomright", area.bottomright, (), self._key_hints)
        key = (round(3.6 * abs(view.speed_mps)),)
        self._put(surface, "speed", "bottomleft", area.bottomleft, key, self._speed)
        if view.teacher_drives:
            at = area.left, self.rects["speed"].top - self._space.px(6)
            self._put(surface, "driver", "bottomleft", at, (), self._driver)
        self.wheel.draw(surface, view.needle, view.agent_needle)
        self.rects["wheel"] = self.wheel.area
        if view.outcome in _ENDS:
            self._say_end(surface, view.outcome)

    def _mark_goal(
        self, surface: pygame.Surface, view: DriveView, ball_xy_m: tuple[float, float]
    ) -> None:
        """A ring around the ball, whatever is before it; an arrow at the edge if it is out of view."""
        width, height = self._size
        x_px, y_px, ahead_m = self._viewpoint.seen(
            view.pose, (*ball_xy_m, BALL_RADIUS_M), self._size
        )
        half = self._space.px(26)
        if ahead_m > BALL_RADIUS_M and half < x_px < width - half:
            top = self._viewpoint.seen(view.pose, (*ball_xy_m, 2.0 * BALL_RADIUS_M), self._size)
            radius = min(max(1.15 * (y_px - top.y_px), self._space.px(13)), 0.12 * height)
            mark = _goal_ring(2 * _RING_STEP * round(radius / _RING_STEP), self._space.px(3))
            self.rects["marker"] = surface.blit(mark, mark.get_rect(center=(x_px, y_px)))
            return
        left = bearing_rad(view.pose, ball_xy_m) > 0.0
        mark = _edge_arrow(2 * half, shapes.ARROW_STEPS // 4 * (1 if left else 3))
        x = half + self._space.px(14)
        x = x if left else width - x
        self.rects["marker"] = surface.blit(mark, mark.get_rect(center=(x, round(0.42 * height))))

    def _say_end(self, surface: pygame.Surface, outcome: Outcome) -> None:
        """How the drive ended: on the edge of the picture, and in a word."""
        words, colour, sign = _ENDS[outcome]
        (width, height), line = self._size, self._space.px(12)
        for edge in (
            (0, 0, width, line),
            (0, height - line, width, line),
            (0, 0, line, height),
            (width - line, 0, line, height),
        ):
            surface.fill(colour, edge)
        mark = sign(self._text.px(30), colour, PANEL)
        part = self._panel([[mark, self._text.line(said(words), 26, WORDS)]])
        at = width // 2, height // 3 + self._space.px(8)
        self.rects["end"] = surface.blit(part, part.get_rect(midtop=at))

    def _put(
        self,
        surface: pygame.Surface,
        name: str,
        anchor: str,
        at: tuple[int, int],
        key: tuple[object, ...],
        make: Callable[..., pygame.Surface],
    ) -> None:
        known = self._parts.get(name)
        if known is None or known[0] != key:
            known = self._parts[name] = key, make(*key)
        part = known[1]
        self.rects[name] = surface.blit(part, part.get_rect(**{anchor: at}))

    def _progress(self, number: int, count: int, balls: int | None) -> pygame.Surface:
        text = self._text
        room_px = self._room_px
        if balls is None:
            head = said("Rollout {number} of {count}").format(number=number, count=count)
            row = [pips(text, number - 1, count, current=number, width_px=room_px)]
        else:
            words = said("{balls} of {count} balls").format(balls=balls, count=count)
            head, reached = said("Practice"), text.line(words, _TEXT, WORDS)
            room_px = max(text.px(40), room_px - reached.get_width() - text.px(8))
            row = [pips(text, balls, count, width_px=room_px), reached]
        return self._panel([[text.line(head, _HEAD, WORDS)], row])

    def _goal(self, metres: int, step: int) -> pygame.Surface:
        text = self._text
        arrow = shapes.arrow(text.px(36), GOAL, step)
        digits = text.line(f"{metres} m", _DIGITS, WORDS)
        widest = text.width("88 m", _DIGITS)  # so that the panel does not breathe with the digits
        size = max(widest, digits.get_width()), digits.get_height()
        room = pygame.Surface(size, pygame.SRCALPHA)
        room.blit(digits, digits.get_rect(midright=room.get_rect().midright))
        return self._panel([[arrow, room]])

    def _status(self, recording: bool, seconds: int, device: str, ok: bool) -> pygame.Surface:
        text, mark = self._text, self._text.px(14)
        time = text.line(f"{seconds // 60}:{seconds % 60:02}", _HEAD, WORDS)
        if recording:
            first = [shapes.disc(mark, ERROR), text.line(said("REC"), _HEAD, WORDS), time]
        else:
            first = [shapes.ring(mark, QUIET), text.line(said("not recorded"), _TEXT, QUIET), time]
        room_px = self._room_px - mark - text.px(8)
        if ok:
            sign, words = shapes.tick(mark, GOOD), f"{device} OK"
            if text.width(words, _TEXT) > room_px:
                words = text.shortened(device, _TEXT, room_px - text.width(" OK", _TEXT)) + " OK"
        else:
            sign, words = shapes.cross(mark, ERROR), said("not heard: ")
            words += text.shortened(device, _TEXT, room_px - text.width(words, _TEXT))
        return self._panel([first, [sign, text.line(words, _TEXT, WORDS)]])

    def _key_hints(self) -> pygame.Surface:
        text = self._text
        caps = [keycap(text, key, _TEXT) for key, _ in _KEYS]
        widest = max(cap.get_width() for cap in caps)
        rows: list[list[pygame.Surface]] = []
        for cap, (_, does) in zip(caps, _KEYS, strict=True):
            column = pygame.Surface((widest, cap.get_height()), pygame.SRCALPHA)
            column.blit(cap, cap.get_rect(midright=column.get_rect().midright))
            rows.append([column, text.line(said(does), _TEXT, WORDS)])
        return self._panel(rows, gap=4)

    def _speed(self, kmh: int) -> pygame.Surface:
        text = self._text
        digits = text.line(f"{kmh}", 26, WORDS)
        size = max(text.width("88", 26), digits.get_width()), digits.get_height()
        room = pygame.Surface(size, pygame.SRCALPHA)
        room.blit(digits, digits.get_rect(midright=room.get_rect().midright))
        return self._panel([[room, text.line("km/h", _TEXT, QUIET)]])

    def _driver(self) -> pygame.Surface:
        text = self._text
        words = text.line(said("You drive"), _HEAD, WORDS)
        return self._panel([[shapes.target(text.px(18), ACCENT), words]])

    def _instruction(self, words: str, room_px: int) -> pygame.Surface:
        text, room_px = self._text, room_px - self._space.px(24)
        size = _LINE
        while size > _SMALLEST_LINE and text.width(words, size) > room_px:
            size -= 1
        return self._panel([[text.line(text.shortened(words, size, room_px), size, WORDS)]])

    def _panel(self, rows: list[list[pygame.Surface]], gap: int = 6) -> pygame.Surface:
        """Rows of things on a panel, from the left, each centred in its row."""
        space = self._space
        pad_x, pad_y, between, gap_px = space.px(12), space.px(8), self._text.px(8), space.px(gap)
        least = self._text.line(" ", _TEXT, WORDS).get_height()
        heights = [max(least, *(part.get_height() for part in row)) for row in rows]
        width = max(sum(part.get_width() + between for part in row) - between for row in rows)
        size = width + 2 * pad_x, sum(heights) + gap_px * (len(rows) - 1) + 2 * pad_y
        made = shapes.panel(size, space.px(10), PANEL, PANEL_ALPHA).copy()
        top = pad_y
        for row, height in zip(rows, heights, strict=True):
            left = pad_x
            for part in row:
                made.blit(part, (left, top + (height - part.get_height()) // 2))
                left += part.get_width() + between
            top += height + gap_px
        return made


def _goal_key(view: DriveView, ball_xy_m: tuple[float, float]) -> tuple[int, int]:
    """Whole metres to the ball's centre, and the arrow's step."""
    metres = hypot(ball_xy_m[0] - view.pose.x_m, ball_xy_m[1] - view.pose.y_m)
    turn = bearing_rad(view.pose, ball_xy_m) / (2.0 * pi)
    return round(metres), round(turn * shapes.ARROW_STEPS) % shapes.ARROW_STEPS


@lru_cache(maxsize=128)
def _goal_ring(px: int, line: int) -> pygame.Surface:
    """A bright ring in a dark one, so that it is seen before a dark block and before the sky."""
    mark = shapes.frame((px, px), px // 2, GROUND, 2 * line).copy()
    inner = shapes.frame((px - line, px - line), px // 2, GOAL, line)
    mark.blit(inner, inner.get_rect(center=mark.get_rect().center))
    return mark


@lru_cache(maxsize=4)
def _edge_arrow(px: int, step: int) -> pygame.Surface:
    """To the left or to the right, in the goal's colour on a dark disc."""
    mark = shapes.panel((px, px), px // 2, PANEL, PANEL_ALPHA).copy()
    arrow = shapes.arrow(round(0.7 * px), GOAL, step)
    mark.blit(arrow, arrow.get_rect(center=mark.get_rect().center))
    return mark
