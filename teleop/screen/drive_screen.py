"""``Screen`` in a window: the world as the car sees it, the instruments over it, and the pages."""

from collections.abc import Callable
from math import pi
from time import perf_counter_ns
from types import TracebackType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from steerlab.sim.engine.camera import CameraConfig
from steerlab.sim.engine.world_view import WorldView
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.language import said
from steerlab.sim.world import WorldSpec
from steerlab.teleop.loudspeaker import open_loudspeaker
from steerlab.teleop.screen.config import SMALLEST, ScreenConfig
from steerlab.teleop.screen.contract import Act, DriveView, Page
from steerlab.teleop.screen.hud import Hud
from steerlab.teleop.screen.pages import PageArtist
from steerlab.teleop.screen.resolution import Quality, Resolution, choose_resolution
from steerlab.teleop.screen.text import Typesetter
from steerlab.teleop.screen.widgets import notice
from steerlab.teleop.screen.window import Window
from steerlab.teleop.sdl import SdlEvents, pygame

_DIM = (92, 92, 92)  # of 255: what a dimmed picture keeps of its light


class WorldPicture(Protocol):
    """Draws a world; ``WorldView`` does."""

    def frame(
        self, pose: Pose2D, road_wheel_rad: float, out: NDArray[np.uint8]
    ) -> NDArray[np.uint8]:
        """Draw the car at ``pose`` into ``out``, (height, width, 3) RGB."""
        ...

    def close(self) -> None:
        """Free the picture's resources."""
        ...


PictureMaker = Callable[[WorldSpec, CameraConfig], WorldPicture]


class DriveScreen:
    """A window that shows drives and pages, and sounds like them; close it before its events.

    Args:
        events: opened with ``window=True``.
        make_picture, now_ns: tests pass their own.

    Attributes:
        resolution: in which the world is drawn, and why; None before the first ``enter``.
        loudspeaker: hears all that is shown.

    Raises:
        NoDisplay: the window system refuses the window.
        NoMonitor: the monitor it should be on is not there.
    """

    def __init__(
        self,
        events: SdlEvents,
        config: ScreenConfig | None = None,
        *,
        make_picture: PictureMaker = WorldView,
        now_ns: Callable[[], int] = perf_counter_ns,
    ) -> None:
        self.config = config or ScreenConfig()
        self.resolution: Resolution | None = None
        self.window = Window(events, self.config, now_ns=now_ns)
        self.loudspeaker = open_loudspeaker(self.config.sound)
        self._make_picture, self._now_ns = make_picture, now_ns
        self._world: WorldSpec | None = None
        self._picture: WorldPicture | None = None
        self._canvas, self._quality = _Canvas(self.window.surface, 1), Quality(1, 0)
        self._dimmed: pygame.Surface | None = None
        self._size_px = (0, 0)
        self._fit_window()

    @property
    def focused(self) -> bool:
        """The window has the keyboard's focus."""
        return self.window.focused

    def acts(self) -> list[Act]:
        """What was asked for since the last call; the event queue must have been polled.

        Raises:
            DisplayLost: the window is gone.
        """
        return self.window.acts()

    def press(self, act: Act) -> None:
        """Take ``act`` as if its key had been pressed: by a button of the wheel."""
        self.window.press(act)

    @property
    def settings(self) -> dict[str, str]:
        """What was shown and heard how; kept with each session, since labels may depend on it."""
        return {
            "drawn": str(self.resolution),
            "view": self.config.view,
            "window": self.window.place,
            "sound": self.loudspeaker.said,
        }

    def enter(self, world: WorldSpec) -> None:
        """Build the scene, and choose the finest picture of it that this machine draws in time.

        Raises:
            NoRenderer: this machine has no OpenGL back end that can draw offscreen.
            DisplayLost: the window is gone.
        """
        self._leave()
        self.show_page(_waiting())
        self._world = world
        unseen = self.window.surface.copy()  # the page stays while frames are measured
        before = self.resolution
        self.resolution = choose_resolution(
            self.window.size_px,
            lambda quality, turn: self._try_frame(unseen, quality, turn),
            budget_ms=self.config.frame_budget_ms,
            before=before,
            now_ns=self._now_ns,
        )
        chosen = self.resolution
        if before and (before.window_px, before.quality) == (chosen.window_px, chosen.quality):
            self.resolution = before  # keeps the figures it was chosen by
        self._draw_world(world.start, 0.0, unseen)

    def show_drive(self, view: DriveView) -> None:
        """Draw one frame of a drive and put it on the display.

        Raises:
            InvalidConfig: no world was entered.
            DisplayLost: the window is gone.
        """
        self._fit_window()
        world = self._draw_world(view.pose, view.road_wheel_rad, self.window.surface)
        self._hud.draw(self.window.surface, view, world.ball_xy_m)
        self._ask(round(0.215 * self.window.size_px[1]), "midtop")
        self.window.flip()
        self.loudspeaker.drive(view)

    def show_page(self, page: Page) -> None:
        """Draw a page and put it on the display.

        Raises:
            DisplayLost: the window is gone.
        """
        self._fit_window()
        surface = self.window.surface
        ground = self._dimmed_drive() if page.over_drive else None
        self._pages.draw(surface, page, ground)
        self._ask(self.window.size_px[1] - self._notices.px(14), "midbottom")
        self.window.flip()
        self.loudspeaker.page(page)

    def save(self, path: str) -> None:
        """Save the window's content as an image file."""
        pygame.image.save(self.window.surface, path)

    def close(self) -> None:
        """Free the picture and stop listening; calling it again does nothing."""
        self._leave()
        self.loudspeaker.close()
        self.window.close()

    def _ask(self, y_px: int, anchor: str) -> None:
        """What was pressed once and must be pressed again, over everything else."""
        if (question := self.window.question) is not None:
            words = notice(self._notices, question)
            at = words.get_rect(**{anchor: (self.window.size_px[0] // 2, y_px)})
            self.window.surface.blit(words, at)

    def _fit_window(self) -> None:
        """Lay everything out anew if a window manager gave the window another size."""
        if self.window.size_px != self._size_px:
            self._size_px = self.window.size_px
            width, height = self._size_px
            size = max(width, SMALLEST[0]), max(height, SMALLEST[1])
            self._hud = Hud(size, self.config.text_scale, self.config.view)
            self._pages = PageArtist(size, self.config.text_scale)
            self._notices = Typesetter(min(size[0] / 960, size[1] / 540) * self.config.text_scale)
            self._dimmed = None

    def _leave(self) -> None:
        if self._picture is not None:
            self._picture.close()
        self._picture = self._dimmed = None

    def _try_frame(self, unseen: pygame.Surface, quality: Quality, turn: float) -> None:
        """A frame as in a drive, but for the instruments, looking ``turn`` of a turn aside."""
        world = self._world
        assert world is not None
        if self._picture is None or self._quality != quality:
            self._leave()
            self._canvas, self._quality = _Canvas(self.window.surface, quality.divisor), quality
            width, height = self._canvas.size_px
            camera = CameraConfig(
                width=width, height=height, view=self.config.view, samples=quality.samples
            )
            self._picture = self._make_picture(world, camera)
        start = world.start
        pose = Pose2D(start.x_m, start.y_m, start.heading_rad + 2.0 * pi * turn)
        self._draw_world(pose, 0.0, unseen)
        self.window.flip()

    def _draw_world(
        self, pose: Pose2D, road_wheel_rad: float, surface: pygame.Surface
    ) -> WorldSpec:
        if self._world is None or self._picture is None:
            raise InvalidConfig("No world to show; call enter(world) before show_drive(view).")
        self._picture.frame(pose, road_wheel_rad, self._canvas.pixels)
        self._canvas.show(surface)
        self._dimmed = None
        return self._world

    def _dimmed_drive(self) -> pygame.Surface | None:
        """The last picture without instruments, darker; None if there was none."""
        if self._dimmed is None and self._picture is not None:
            self._dimmed = self.window.surface.copy()
            self._canvas.show(self._dimmed)
            self._dimmed.fill(_DIM, special_flags=pygame.BLEND_RGB_MULT)
        return self._dimmed

    def __enter__(self) -> "DriveScreen":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _Canvas:
    """Pixels that the world is drawn into, shown at the window's size."""

    def __init__(self, window: pygame.Surface, divisor: int) -> None:
        width, height = window.get_width() // divisor, window.get_height() // divisor
        self.size_px = width, height
        self.pixels = np.zeros((height, width, 3), np.uint8)
        self._as_surface = pygame.image.frombuffer(self.pixels.data, (width, height), "RGB")
        self._converted = pygame.Surface((width, height), depth=32)  # what can be scaled

    def show(self, window: pygame.Surface) -> None:
        if window.get_size() == self.size_px:
            window.blit(self._as_surface, (0, 0))
            return
        self._converted.blit(self._as_surface, (0, 0))
        pygame.transform.smoothscale(self._converted, window.get_size(), window)


def _waiting() -> Page:
    return Page(title=said("One moment"), lines=(said("The drive is being made ready."),))
