"""The contract of every input device, and the records it deals in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from steerlab.sim.errors import SteerlabError
from steerlab.sim.rollout import Rollout


class DeviceError(SteerlabError):
    """A device is missing, ambiguous, not calibrated, or was lost."""


class InputKind(StrEnum):
    """The kind of device; kept with each session, and never pooled silently."""

    WHEEL = "wheel"
    GAMEPAD = "gamepad"
    KEYBOARD = "keyboard"
    MOUSE = "mouse"
    SCRIPTED = "scripted"
    TRACE = "trace"


class Button(StrEnum):
    """What a button does, whatever its number on the device."""

    PAUSE = "pause"
    REDO = "redo"
    TAKE_OVER = "take_over"


@dataclass(frozen=True, kw_only=True, slots=True)
class DeviceInfo:
    """The description of a device, kept with each session.

    Attributes:
        guid: SDL's; empty for devices that have none.
        profile_sha256: of the profile file the axes were read with; empty without one.
        force_feedback: ``off: why``, or what is on with its strength.
        buttons: those that the device has, whatever their numbers are.
        details: what else tells devices apart: rate, resolution, dead zone, operating system.
    """

    kind: InputKind
    name: str
    guid: str = ""
    profile_sha256: str = ""
    force_feedback: str = "off: not asked for"
    buttons: frozenset[Button] = frozenset()
    details: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, slots=True)
class DeviceSample:
    """The current reading of a device.

    Attributes:
        wheel: position in [-2.5, 2.5], positive left; None while it is unknown (no event yet,
            unplugged), which is never the same as 0.
        throttle, brake: [0, 1]; None where the device has no such pedal or it is unknown.
        buttons: those held down.
        t_event_ns: ``perf_counter_ns`` of the device's last event; None before the first one.
        ok: connected, armed and known: the label may be used.
    """

    wheel: float | None
    throttle: float | None = None
    brake: float | None = None
    buttons: frozenset[Button] = frozenset()
    t_event_ns: int | None = None
    ok: bool = True


class Device(Protocol):
    """A device that a teacher steers with.

    ``connect`` raises ``DeviceError`` when it cannot; a lost device is never replaced by another:
    ``read`` then gives ``ok=False`` until the same one is back.
    """

    @property
    def info(self) -> DeviceInfo:
        """Kind, name and details; complete once connected."""
        ...

    def connect(self) -> None:
        """Find and open it.

        Raises:
            DeviceError: it is missing, ambiguous or not calibrated.
        """
        ...

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """A new attempt starts: virtual wheels centre, scripts and traces start over.

        Args:
            rollout: what will be shown; None when it does not exist yet, as in a live drive.
            order: its place in the session, from 0.
        """
        ...

    def read(self, step: int | None = None) -> DeviceSample:
        """The current sample; ``step`` is the control step, which only scripts and traces need."""
        ...

    def disconnect(self) -> None:
        """Close it; calling it again does nothing."""
        ...
