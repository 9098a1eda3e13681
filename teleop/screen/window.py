"""The window: what is pressed in it, whether it has the focus, and its pixels."""

import os
from types import TracebackType

from steerlab.teleop.screen.config import ScreenConfig
from steerlab.teleop.screen.contract import Act
from steerlab.teleop.screen.display_loss import DisplayLost, display_is_lost, outlive_display
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
        """Has the keyboard's focus, as of the last poll."""
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
