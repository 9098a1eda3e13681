"""``Screen`` in a window: the world as the car sees it, the instruments over it, and the pages."""

import os
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
from steerlab.sim.world import WorldSpec
from steerlab.teleop.screen.config import SMALLEST, ScreenConfig
from steerlab.teleop.screen.contract import Act, DriveView, Page
from steerlab.teleop.screen.display_loss import DisplayLost, display_is_lost, outlive_display
from steerlab.teleop.screen.hud import Hud
from steerlab.teleop.screen.pages import PageArtist
from steerlab.teleop.screen.resolution import Resolution, choose_resolution
from steerlab.teleop.sdl import NoDisplay, SdlEvents, pygame

TITLE = "steerlab"
_KEYS = {
    pygame.K_SPACE: Act.CONFIRM,
    pygame.K_RETURN: Act.CONFIRM,
    pygame.K_KP_ENTER: Act.CONFIRM,
    pygame.K_p: Act.PAUSE,
    pygame.K_r: Act.REDO,
    pygame.K_ESCAPE: Act.STOP,
}
_WAIT = Page(title="One moment")
_DIM = (92, 92, 92)  # of 255: what a dimmed picture keeps of its light


class Window:
    """A window on ``events``; close it before them.

    Raises:
        NoDisplay: the window system refuses the window.
    """

    def __init__(self, events: SdlEvents, config: ScreenConfig) -> None:
        # SDL would else show the window through OpenGL where that is fast, and take no notice
        # that MuJoCo makes its own context the current one in between.
        os.environ["SDL_FRAMEBUFFER_ACCELERATION"] = "0"
        size, flags = (config.width, config.height), 0
        if config.full_screen:
            size, flags = (0, 0), pygame.FULLSCREEN
        try:
            self.surface = pygame.display.set_mode(size, flags)
        except pygame.error as error:
            raise NoDisplay(f"No window of {config.width}x{config.height}: {error}.") from error
        pygame.display.set_caption(TITLE)
        pygame.mouse.set_visible(not config.full_screen)
        self.outlives_display = outlive_display(pygame.display.get_wm_info(), pygame.quit)
        self._acts: list[Act] = []
        self._stop_listening = events.listen(self._hear)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.surface.get_size()

    @property
    def focused(self) -> bool:
        """Whether the window has the keyboard's focus, as of the last poll."""
        return pygame.key.get_focused()

    def acts(self) -> list[Act]:
        """What was asked for since the last call.

        Raises:
            DisplayLost: the window is gone.
        """
        self._check()
        acts, self._acts = self._acts, []
        return acts

    def flip(self) -> None:
        """Put the surface on the display.

        Raises:
            DisplayLost: the window is gone.
        """
        self._check()
        pygame.display.flip()
        self._check()

    def close(self) -> None:
        """Stop listening; the window goes with its events. Calling it again does nothing."""
        self._stop_listening()

    def _check(self) -> None:
        if display_is_lost():
            raise DisplayLost

    def _hear(self, event: pygame.event.Event, _now_ns: int) -> None:
        act = None
        if event.type == pygame.KEYDOWN:
            act = _KEYS.get(event.key)
        elif event.type == pygame.QUIT:  # the close button, or the system asking to end
            act = Act.STOP
        elif event.type == pygame.WINDOWFOCUSLOST:
            act = Act.FOCUS_LOST
        if act is not None:
            self._acts.append(act)

    def __enter__(self) -> "Window":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


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
    """A window that shows drives and pages; close it before its events.

    Args:
        events: opened with ``window=True``.
        make_picture, now_ns: tests pass their own.

    Attributes:
        resolution: in which the world is drawn, and why; None before the first ``enter``.

    Raises:
        NoDisplay: the window system refuses the window.
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
        self.window = Window(events, self.config)
        self._make_picture, self._now_ns = make_picture, now_ns
        self._world: WorldSpec | None = None
        self._picture: WorldPicture | None = None
        self._canvas = _Canvas(self.window.surface, 1)
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

    def enter(self, world: WorldSpec) -> None:
        """Build the scene, and choose the finest picture of it that this machine draws in time.

        Raises:
            NoRenderer: this machine has no OpenGL back end that can draw offscreen.
            DisplayLost: the window is gone.
        """
        self._leave()
        self.show_page(_WAIT)
        self._world = world
        unseen = self.window.surface.copy()  # the page stays while frames are measured
        before = self.resolution
        self.resolution = choose_resolution(
            self.window.size_px,
            lambda divisor, turn: self._try_frame(unseen, divisor, turn),
            budget_ms=self.config.frame_budget_ms,
            before=before,
            now_ns=self._now_ns,
        )
        if before is not None and before.render_px == self.resolution.render_px:
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
        self.window.flip()

    def show_page(self, page: Page) -> None:
        """Draw a page and put it on the display.

        Raises:
            DisplayLost: the window is gone.
        """
        self._fit_window()
        surface = self.window.surface
        ground = self._dimmed_drive() if page.over_drive else None
        self._pages.draw(surface, page, ground)
        self.window.flip()

    def save(self, path: str) -> None:
        """Save the window's content as an image file."""
        pygame.image.save(self.window.surface, path)

    def close(self) -> None:
        """Free the picture and stop listening; calling it again does nothing."""
        self._leave()
        self.window.close()

    def _fit_window(self) -> None:
        """Lay everything out anew if a window manager gave the window another size."""
        if self.window.size_px != self._size_px:
            self._size_px = self.window.size_px
            width, height = self._size_px
            size = max(width, SMALLEST[0]), max(height, SMALLEST[1])
            self._hud = Hud(size, self.config.text_scale, self.config.view)
            self._pages = PageArtist(size, self.config.text_scale)
            self._dimmed = None

    def _leave(self) -> None:
        if self._picture is not None:
            self._picture.close()
        self._picture = self._dimmed = None

    def _try_frame(self, unseen: pygame.Surface, divisor: int, turn: float) -> None:
        """A frame as in a drive, but for the instruments, looking ``turn`` of a turn aside."""
        world = self._world
        assert world is not None
        if self._picture is None or self._canvas.divisor != divisor:
            self._leave()
            self._canvas = _Canvas(self.window.surface, divisor)
            width, height = self._canvas.size_px
            camera = CameraConfig(width=width, height=height, view=self.config.view)
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
        self.divisor = divisor
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
