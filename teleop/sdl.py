"""SDL, started once: the only place that imports pygame's event queue, shared by all who listen.

Window and wheel get their events from one queue, so one object empties it and passes each event
on, stamped with the time it was taken. Polled every millisecond, that is the event's own time.
"""

import os
from collections.abc import Callable
from time import perf_counter_ns
from typing import TYPE_CHECKING

from steerlab.sim.errors import SteerlabError
from steerlab.teleop.screen.display_loss import display_is_lost

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Without it SDL passes on only centring motion while the window has no focus: biased labels.
os.environ["SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS"] = "1"

import pygame  # the variables above must be set first

if TYPE_CHECKING:
    from types import TracebackType

Listener = Callable[[pygame.event.Event, int], None]
"""Told each event and when it was taken, in ``perf_counter_ns``."""


class NoDisplay(SteerlabError):
    """There is no display to open a window on."""


class SdlEvents:
    """The event queue of this process; open it before any device or window, close it after.

    Args:
        window: a window will be opened, so a display is needed; without, SDL's dummy driver
            serves and joysticks work all the same.

    Raises:
        NoDisplay: a window is wanted and there is no display.
    """

    def __init__(self, *, window: bool) -> None:
        if window:
            if os.environ.get("SDL_VIDEODRIVER") == "dummy":
                del os.environ["SDL_VIDEODRIVER"]
        else:
            os.environ["SDL_VIDEODRIVER"] = "dummy"
        try:
            pygame.display.init()
        except pygame.error as error:
            raise NoDisplay(
                f"No display to open a window on ({error}); DISPLAY is "
                f"{os.environ.get('DISPLAY', 'not set')!r}. Log in to a desktop, or run under Xvfb."
            ) from error
        pygame.joystick.init()
        self._listeners: list[Listener] = []

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Pass each event on to ``listener`` from now on; the function returned stops that."""
        self._listeners.append(listener)

        def stop() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return stop

    def poll(self) -> None:
        """Empty the queue; cheap (about 10 µs) when nothing happened.

        Raises:
            KeyboardInterrupt: SDL has taken a SIGTERM, and there is no window to hear of it.
        """
        for event in pygame.event.get():
            if event.type == pygame.QUIT and pygame.display.get_surface() is None:
                raise KeyboardInterrupt
            now_ns = perf_counter_ns()
            for listener in tuple(self._listeners):
                listener(event, now_ns)

    def close(self) -> None:
        """Close joysticks and display; windows are gone after this."""
        self._listeners.clear()
        if display_is_lost():
            return
        pygame.joystick.quit()
        pygame.display.quit()

    def __enter__(self) -> "SdlEvents":
        return self

    def __exit__(
        self,
        kind: "type[BaseException] | None",
        error: "BaseException | None",
        trace: "TracebackType | None",
    ) -> None:
        self.close()
