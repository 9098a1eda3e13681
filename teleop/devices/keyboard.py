"""A virtual wheel turned by keys: left and right, A and D; it turns at a limited rate."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter_ns

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import Button, DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.sdl import SdlEvents, pygame

_LEFT = (pygame.K_LEFT, pygame.K_a)
_RIGHT = (pygame.K_RIGHT, pygame.K_d)
_THROTTLE = (pygame.K_UP, pygame.K_w)
_BRAKE = (pygame.K_DOWN, pygame.K_s)
_TAKE_OVER = (pygame.K_LSHIFT, pygame.K_RSHIFT)
_KEYS = frozenset((*_LEFT, *_RIGHT, *_THROTTLE, *_BRAKE, *_TAKE_OVER))


@dataclass(frozen=True, kw_only=True)
class KeyboardConfig:
    """How fast the virtual wheel turns, in wheel units of [-2.5, 2.5] a second."""

    turn_per_s: float = 4.0  # from straight to full lock in 0.6 s
    return_per_s: float = 5.0  # without a key, or with both

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0.0:
                raise InvalidConfig(f"KeyboardConfig.{name} is {value}; it must be positive.")


class KeyboardDevice:
    """A virtual wheel that turns with time, however often it is read.

    Args:
        now_ns: the clock that stamps the events; tests pass their own.
    """

    def __init__(
        self,
        events: SdlEvents,
        config: KeyboardConfig | None = None,
        *,
        now_ns: Callable[[], int] = perf_counter_ns,
    ) -> None:
        self._events = events
        self._config = config or KeyboardConfig()
        self._now_ns = now_ns
        self._stop: Callable[[], None] | None = None
        self._down: set[int] = set()
        self._wheel = 0.0
        self._at_ns = 0
        self._t_event_ns: int | None = None

    @property
    def info(self) -> DeviceInfo:
        """The device, with the rates at which its wheel turns."""
        details = {name: f"{value:g}" for name, value in vars(self._config).items()}
        return DeviceInfo(kind=InputKind.KEYBOARD, name="keyboard", details=details)

    def connect(self) -> None:
        """Listen to keys; the window must have the focus to get any."""
        if self._stop is None:
            self._stop = self._events.listen(self._on_event)
            self._centre()

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Centre the virtual wheel; a key that is down turns it from there."""
        self._centre()

    def read(self, step: int | None = None) -> DeviceSample:
        """The current position of the virtual wheel."""
        if self._stop is None:
            return DeviceSample(wheel=None, ok=False)
        self._turn_until(self._now_ns())
        return DeviceSample(
            wheel=self._wheel,
            throttle=float(self._any(_THROTTLE)),
            brake=float(self._any(_BRAKE)),
            buttons=frozenset({Button.TAKE_OVER} if self._any(_TAKE_OVER) else ()),
            t_event_ns=self._t_event_ns,
        )

    def disconnect(self) -> None:
        """Stop listening; calling it again does nothing."""
        if self._stop is not None:
            self._stop()
            self._stop = None
        self._down.clear()

    def _on_event(self, event: pygame.event.Event, now_ns: int) -> None:
        if event.type == pygame.WINDOWFOCUSLOST:
            self._turn_until(now_ns)
            self._down.clear()  # their release would go to another window
        elif event.type in (pygame.KEYDOWN, pygame.KEYUP) and event.key in _KEYS:
            self._turn_until(now_ns)
            self._t_event_ns = now_ns
            (self._down.add if event.type == pygame.KEYDOWN else self._down.discard)(event.key)

    def _turn_until(self, now_ns: int) -> None:
        passed_s = max(0, now_ns - self._at_ns) / 1e9
        self._at_ns = max(self._at_ns, now_ns)
        turn = self._any(_LEFT) - self._any(_RIGHT)
        if turn:
            self._wheel += turn * self._config.turn_per_s * passed_s
            self._wheel = min(WHEEL_LIMIT, max(-WHEEL_LIMIT, self._wheel))
            return
        back = self._config.return_per_s * passed_s
        self._wheel = max(0.0, self._wheel - back) + min(0.0, self._wheel + back)

    def _centre(self) -> None:
        self._wheel, self._at_ns = 0.0, self._now_ns()

    def _any(self, keys: tuple[int, ...]) -> bool:
        return not self._down.isdisjoint(keys)
