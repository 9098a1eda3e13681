"""The window itself: where it stands, what it is called, and what is pressed in it."""

import os
from collections.abc import Callable
from time import perf_counter_ns
from types import TracebackType

from steerlab.teleop.screen import shapes
from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.confirm import Confirm
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.screen.display_loss import DisplayLost, display_is_lost, outlive_display
from steerlab.teleop.screen.monitors import choose_monitor
from steerlab.teleop.screen.palette import ACCENT, GROUND, WORDS
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
_ICON_PX = 64


class Window:
    """A window on ``events``; close it before them.

    Attributes:
        place: what it fills, such as ``full screen on 0 (DELL U2415, 1920x1200)``.

    Raises:
        NoDisplay: the window system refuses the window.
        NoMonitor: the monitor it should be on is not there.
    """

    def __init__(
        self,
        events: SdlEvents,
        config: ScreenConfig,
        *,
        now_ns: Callable[[], int] = perf_counter_ns,
    ) -> None:
        # SDL would else show the window through OpenGL where that is fast, and take no notice
        # that MuJoCo makes its own context the current one in between.
        os.environ["SDL_FRAMEBUFFER_ACCELERATION"] = "0"
        # A click on another monitor would else hide what a participant looks at.
        os.environ["SDL_VIDEO_MINIMIZE_ON_FOCUS_LOSS"] = "0"
        monitor = choose_monitor(config.monitor)
        size, flags = (config.width, config.height), 0
        self.place = f"window of {config.width}x{config.height}"
        if config.full_screen:
            size, flags = monitor.size_px, pygame.FULLSCREEN
            self.place = f"full screen on {monitor}"
        pygame.display.set_icon(_icon())
        try:
            self.surface = pygame.display.set_mode(size, flags, display=monitor.number)
        except pygame.error as error:
            raise NoDisplay(f"No {self.place}: {error}.") from error
        pygame.display.set_caption(TITLE)
        pygame.mouse.set_visible(not config.full_screen)
        self.outlives_display = outlive_display(pygame.display.get_wm_info(), pygame.quit)
        self._confirm = Confirm(now_ns)
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

    @property
    def question(self) -> str | None:
        """What was pressed once and must be pressed again; None most of the time."""
        return self._confirm.question

    def acts(self) -> list[Act]:
        """What was asked for since the last call; what ends something only if it was pressed twice.

        Raises:
            DisplayLost: the window is gone.
        """
        self._check()
        acts, self._acts = self._acts, []
        return acts

    def press(self, act: Act) -> None:
        """Take ``act`` as if its key had been pressed."""
        counts = self._confirm.press(act)
        if counts is not None:
            self._acts.append(counts)

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
        if event.type == pygame.KEYDOWN and event.key in _KEYS:
            self.press(_KEYS[event.key])
        elif event.type == pygame.QUIT:  # the close button, or the system asking to end
            self._acts.append(Act.STOP)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._acts.append(Act.FOCUS_LOST)

    def __enter__(self) -> "Window":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _icon() -> pygame.Surface:
    """A wheel, and a mark where it points."""
    icon = shapes.panel((_ICON_PX, _ICON_PX), _ICON_PX // 5, GROUND).copy()
    for part in (shapes.ring(50, WORDS), shapes.disc(16, WORDS), shapes.arrow(26, ACCENT, 0)):
        at = part.get_rect(center=icon.get_rect().center)
        if part.get_width() == 26:
            at.bottom = icon.get_height() // 2 - 4
        icon.blit(part, at)
    return icon
