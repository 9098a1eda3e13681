"""A virtual wheel turned by moving the mouse sideways."""

from collections.abc import Callable
from dataclasses import dataclass

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.sdl import SdlEvents, pygame


@dataclass(frozen=True, kw_only=True)
class MouseConfig:
    """How far the mouse moves; pixels as the system counts them, its acceleration included."""

    pixels_to_lock: float = 300.0

    def __post_init__(self) -> None:
        if not self.pixels_to_lock > 0.0:
            raise InvalidConfig(f"pixels_to_lock is {self.pixels_to_lock}; it must be positive.")


class MouseDevice:
    """Each pixel to the left turns left; the pointer is kept in the window during a drive."""

    def __init__(self, events: SdlEvents, config: MouseConfig | None = None) -> None:
        self._events = events
        self._config = config or MouseConfig()
        self._stop: Callable[[], None] | None = None
        self._wheel = 0.0
        self._buttons: set[int] = set()
        self._t_event_ns: int | None = None
        self._grabbed = False

    @property
    def info(self) -> DeviceInfo:
        """The device, with the pixels it takes to full lock."""
        details = {"pixels_to_lock": f"{self._config.pixels_to_lock:g}"}
        return DeviceInfo(kind=InputKind.MOUSE, name="mouse", details=details)

    def connect(self) -> None:
        """Listen to the mouse."""
        if self._stop is None:
            self._stop = self._events.listen(self._on_event)
            self._wheel = 0.0

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Centre the virtual wheel, and keep the pointer from stopping at the window's edge."""
        self._wheel = 0.0
        if self._stop is not None and pygame.display.get_surface() is not None:
            pygame.mouse.set_visible(False)
            pygame.event.set_grab(True)  # hidden and grabbed: motion has no edge
            self._grabbed = True

    def read(self, step: int | None = None) -> DeviceSample:
        """The current position of the virtual wheel; the left button takes over."""
        if self._stop is None:
            return DeviceSample(wheel=None, ok=False)
        held = pygame.BUTTON_LEFT in self._buttons
        return DeviceSample(
            wheel=self._wheel,
            buttons=frozenset({Button.TAKE_OVER} if held else ()),
            t_event_ns=self._t_event_ns,
        )

    def disconnect(self) -> None:
        """Release the pointer and stop listening; calling it again does nothing."""
        if self._stop is not None:
            self._stop()
            self._stop = None
        if self._grabbed and pygame.display.get_init():
            pygame.event.set_grab(False)
            pygame.mouse.set_visible(True)
        self._grabbed = False
        self._buttons.clear()

    def _on_event(self, event: pygame.event.Event, now_ns: int) -> None:
        if event.type == pygame.MOUSEMOTION:
            turned = self._wheel - event.rel[0] * WHEEL_LIMIT / self._config.pixels_to_lock
            self._wheel = min(WHEEL_LIMIT, max(-WHEEL_LIMIT, turned))
        elif event.type == pygame.MOUSEBUTTONDOWN:
            self._buttons.add(event.button)
        elif event.type == pygame.MOUSEBUTTONUP:
            self._buttons.discard(event.button)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._buttons.clear()
            return
        else:
            return
        self._t_event_ns = now_ns
