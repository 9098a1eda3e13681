"""The instruments over a drive, in the upper and lower thirds: the middle stays clear."""

from collections.abc import Callable
from math import hypot, pi

from steerlab.sim.camera_config import View
from steerlab.sim.geometry import bearing_rad
from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.contract import DriveView
from steerlab.teleop.screen.palette import (
    ACCENT,
    ERROR,
    GOAL,
    GOOD,
    PANEL,
    PANEL_ALPHA,
    QUIET,
    WORDS,
)
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import WheelBar, keycap, pips
from steerlab.teleop.sdl import pygame

DRIVE_WORD = "Rollout"
_KEYS = (("P", "pause"), ("R", "redo"), ("Esc", "stop"))
_HEAD, _TEXT, _LINE, _DIGITS = 17, 14, 17, 22  # sizes of text
_SMALLEST_LINE = 10
_LARGEST_BAR = 1.4  # the wheel's bar is read by its shape; larger it would only be in the way


class Hud:
    """Draws a ``DriveView``'s instruments; each part is made again only when it changes.

    Args:
        size: of the surface, width and height.
        text_scale: of the text, on top of the surface's own size.
        view: from behind, the horizon is higher and the instruction stands lower.

    Attributes:
        rects: where each part was drawn last.
    """

    def __init__(
        self, size: tuple[int, int], text_scale: float = 1.0, view: View = "front"
    ) -> None:
        unit = min(size[0] / 960, size[1] / 540)
        self._low = view == "chase"
        self._text = Typesetter(unit * text_scale)
        self._space = Typesetter(unit)  # margins do not grow with the text
        margin = self._space.px(14)
        self._area = pygame.Rect((0, 0), size).inflate(-2 * margin, -2 * margin)
        self._room_px = self._area.width // 3 - self._space.px(36)  # inside an upper panel
        self._parts: dict[str, tuple[tuple[object, ...], pygame.Surface]] = {}
        self.rects: dict[str, pygame.Rect] = {}
        hints = self._key_hints()
        self._parts["keys"] = (), hints
        bar_text = Typesetter(unit * min(text_scale, _LARGEST_BAR))
        room_px = self._area.width - 2 * (hints.get_width() + self._space.px(24))
        wheel = pygame.Rect(0, 0, min(round(0.4 * size[0]), room_px), WheelBar.height_px(bar_text))
        self._wheel_panel = wheel.inflate(self._space.px(20), self._space.px(12))
        self._wheel_panel.midbottom = self._area.midbottom
        wheel.center = self._wheel_panel.center
        self._wheel = WheelBar(wheel, bar_text)
        self.x_px = self._wheel.x_px
        self.track = self._wheel.track

    def draw(
        self, surface: pygame.Surface, view: DriveView, ball_xy_m: tuple[float, float]
    ) -> None:
        """Draw everything on the picture of the world."""
        self.rects.clear()
        area, space = self._area, self._space
        key = (view.number, view.count, view.balls)
        self._put(surface, "progress", "topleft", area.topleft, key, self._progress)
        key = _goal_key(view, ball_xy_m)
        self._put(surface, "goal", "midtop", area.midtop, key, self._goal)
        key = (view.recording, int(view.elapsed_s), view.device, view.device_ok)
        self._put(surface, "status", "topright", area.topright, key, self._status)
        if view.instruction:
            anchor, at, room_px = self._instruction_place()
            key = (view.instruction, room_px)
            self._put(surface, "instruction", anchor, at, key, self._instruction)
        self._put(surface, "keys", "bottomright", area.bottomright, (), self._key_hints)
        if view.teacher_drives:
            self._put(surface, "driver", "bottomleft", area.bottomleft, (), self._driver)
        panel = self._wheel_panel
        surface.blit(shapes.panel(panel.size, space.px(10), PANEL, PANEL_ALPHA), panel)
        self._wheel.draw(surface, view.needle, agent=view.agent_needle)
        self.rects["wheel"] = panel

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
            head = f"{DRIVE_WORD} {number} of {count}"
            row = [pips(text, number - 1, count, current=number, width_px=room_px)]
        else:
            head, reached = "Practice", text.line(f"{balls} of {count} balls", _TEXT, WORDS)
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
            first = [shapes.disc(mark, ERROR), text.line("REC", _HEAD, WORDS), time]
        else:
            first = [shapes.ring(mark, QUIET), text.line("not recorded", _TEXT, QUIET), time]
        room_px = self._room_px - mark - text.px(8)
        if ok:
            sign, words = shapes.tick(mark, GOOD), f"{device} OK"
            if text.width(words, _TEXT) > room_px:
                words = text.shortened(device, _TEXT, room_px - text.width(" OK", _TEXT)) + " OK"
        else:
            sign, words = shapes.cross(mark, ERROR), "not heard: "
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
            rows.append([column, text.line(does, _TEXT, WORDS)])
        return self._panel(rows, gap=4)

    def _driver(self) -> pygame.Surface:
        text = self._text
        return self._panel(
            [[shapes.target(text.px(18), ACCENT), text.line("You drive", _HEAD, WORDS)]]
        )

    def _instruction_place(self) -> tuple[str, tuple[int, int], int]:
        """Anchor, place and width: below the other panels, or between keys and wheel."""
        area, gap = self._area, self._space.px(6)
        if self._low:
            beside = self._parts["keys"][1].get_width() + 2 * gap
            at = area.centerx, self._wheel_panel.top - gap
            return "midbottom", at, area.width - 2 * beside
        below = max(self.rects[name].bottom for name in ("progress", "goal", "status"))
        return "midtop", (area.centerx, below + gap), area.width

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
