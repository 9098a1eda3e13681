"""The raw state of one SDL joystick, from its events alone.

Polling would lie twice: SDL reads 0 on an axis until it first moves, and after unplugging. So an
axis is unknown until an event says that it moved.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from steerlab.teleop.devices.contract import DeviceError
from steerlab.teleop.sdl import SdlEvents, pygame


@dataclass(frozen=True, kw_only=True, slots=True)
class JoystickInfo:
    """SDL's description of a joystick, wheel or gamepad.

    Attributes:
        guid: 32 hexadecimal digits: the same for two devices of one model.
        vendor, product: USB numbers, read from the GUID; 0 where it holds none.
        axes, buttons: how many.
    """

    name: str
    guid: str
    vendor: int
    product: int
    axes: int
    buttons: int

    def __str__(self) -> str:
        return f"{self.name!r} ({self.vendor:04x}:{self.product:04x}, guid {self.guid})"


@dataclass(frozen=True, kw_only=True, slots=True)
class RawSample:
    """A joystick's state, from its events so far.

    Attributes:
        axes: in [-1, 1]; None while unknown, which is until the axis first moves.
        buttons: numbers of those held down.
        t_event_ns: ``perf_counter_ns`` of the last event; None before the first.
        motions: axis events so far, of which the event rate is measured.
        lost: it was unplugged and is not back.
    """

    axes: tuple[float | None, ...]
    buttons: frozenset[int] = frozenset()
    t_event_ns: int | None = None
    motions: int = 0
    lost: bool = False


def list_joysticks() -> list[JoystickInfo]:
    """All joysticks that SDL sees now, in SDL's order; ``SdlEvents`` must be open."""
    _need_sdl()
    return [_info(pygame.joystick.Joystick(index)) for index in range(pygame.joystick.get_count())]


def choose_joystick(
    joysticks: Sequence[JoystickInfo], name: str, what: str = "joystick"
) -> JoystickInfo:
    """The only one whose name or GUID fits ``name``; with no name, the only one there is.

    A full name or GUID goes before a part of a name. Never simply the first.

    Raises:
        DeviceError: none fits, or several do.
    """
    wanted = name.casefold()
    exact = [stick for stick in joysticks if wanted in (stick.name.casefold(), stick.guid)]
    fitting = exact or [stick for stick in joysticks if wanted in stick.name.casefold()]
    if len(fitting) == 1:
        return fitting[0]
    called = f" called {name!r}" if name else ""
    there = ", ".join(map(str, joysticks)) or "none"
    if not fitting:
        raise DeviceError(f"No {what}{called}; found: {there}. Plug it in, or name another.")
    same_model = len({stick.guid for stick in fitting}) == 1
    remedy = "unplug one" if same_model else "name one, or give its guid"
    raise DeviceError(f"Several fit as {what}{called}: {', '.join(map(str, fitting))}; {remedy}.")


class RawJoystick:
    """Follows one joystick through unplugging and replugging.

    Args:
        events: the queue it listens to.
        info: which joystick.
    """

    def __init__(self, events: SdlEvents, info: JoystickInfo) -> None:
        self.info = info
        self._events = events
        self._stop: Callable[[], None] | None = None
        self._handle: pygame.joystick.JoystickType | None = None
        self._t_event_ns: int | None = None
        self._motions = 0
        self.openings = 0  # more than one: it was unplugged in between
        self._forget()

    def open(self) -> None:
        """Open it and listen.

        Raises:
            DeviceError: it is not there, or it is there twice.
        """
        _need_sdl()
        self._events.poll()  # what it said to others before is none of its motions
        handles = map(pygame.joystick.Joystick, range(pygame.joystick.get_count()))
        fitting = [handle for handle in handles if handle.get_guid() == self.info.guid]
        if len(fitting) != 1:
            state = "is not plugged in" if not fitting else f"is there {len(fitting)} times"
            raise DeviceError(f"{self.info} {state}; exactly one of them must be plugged in.")
        self._take(fitting[0])
        if self._stop is None:
            self._stop = self._events.listen(self._on_event)

    def raw(self) -> RawSample:
        """Its state as of the last time the event queue was polled."""
        return RawSample(
            axes=tuple(self._axes),
            buttons=frozenset(self._buttons),
            t_event_ns=self._t_event_ns,
            motions=self._motions,
            lost=self._handle is None,
        )

    def close(self) -> None:
        """Stop listening; calling it again does nothing."""
        if self._stop is not None:
            self._stop()
            self._stop = None
        self._handle = None
        self._forget()

    def _take(self, handle: "pygame.joystick.JoystickType") -> None:
        self._handle = handle
        self._instance = handle.get_instance_id()
        self.openings += 1

    def _forget(self) -> None:
        self._axes: list[float | None] = [None] * self.info.axes
        self._announced: list[float | None] = [None] * self.info.axes
        self._buttons: set[int] = set()

    def _on_event(self, event: pygame.event.Event, now_ns: int) -> None:
        if event.type == pygame.JOYDEVICEADDED:
            if self._handle is None:
                self._reopen(event.device_index)
            return
        if self._handle is None or getattr(event, "instance_id", None) != self._instance:
            return
        if event.type == pygame.JOYDEVICEREMOVED:
            self._handle = None
            self._forget()
        elif event.type == pygame.JOYAXISMOTION:
            self._t_event_ns = now_ns
            self._motions += 1
            self._move(event.axis, max(-1.0, min(1.0, event.value)))
        elif event.type == pygame.JOYBUTTONDOWN:
            self._t_event_ns = now_ns
            self._buttons.add(event.button)
        elif event.type == pygame.JOYBUTTONUP:
            self._t_event_ns = now_ns
            self._buttons.discard(event.button)

    def _reopen(self, index: int) -> None:
        try:
            handle = pygame.joystick.Joystick(index)
        except pygame.error:
            return  # gone again already; coming back it will be announced again
        if handle.get_guid() == self.info.guid:
            self._take(handle)

    def _move(self, axis: int, value: float) -> None:
        """Set an axis, ignoring what SDL announces before its first motion: often a made-up 0."""
        if self._announced[axis] is None:
            self._announced[axis] = value
        if self._axes[axis] is not None or value != self._announced[axis]:
            self._axes[axis] = value


def _info(handle: "pygame.joystick.JoystickType") -> JoystickInfo:
    guid = handle.get_guid()
    vendor, product = usb_ids(guid)
    return JoystickInfo(
        name=handle.get_name(),
        guid=guid,
        vendor=vendor,
        product=product,
        axes=handle.get_numaxes(),
        buttons=handle.get_numbuttons(),
    )


def usb_ids(guid: str) -> tuple[int, int]:
    """Vendor and product in an SDL GUID, (0, 0) if it holds a name instead of numbers.

    Layout (SDL_joystick.c): little-endian 16-bit bus, checksum, vendor, 0, product, 0, version,
    driver.
    """
    words = [int.from_bytes(bytes.fromhex(guid[i : i + 4]), "little") for i in range(0, 32, 4)]
    return (words[2], words[4]) if words[3] == 0 and words[5] == 0 else (0, 0)


def _need_sdl() -> None:
    if not pygame.joystick.get_init():
        raise DeviceError("SDL is not running; open SdlEvents before a device and close it after.")
