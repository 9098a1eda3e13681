"""The screen's contract: what is shown, and which acts come back. The loop knows no more of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, Protocol

from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import WorldSpec


class Act(StrEnum):
    """What the person at the keyboard (or the window system) asked for since the last look."""

    CONFIRM = "confirm"  # space or enter
    PAUSE = "pause"  # P
    REDO = "redo"  # R, twice
    STOP = "stop"  # escape, twice; or the window's close button
    FOCUS_LOST = "focus_lost"


@dataclass(frozen=True, kw_only=True, slots=True)
class DriveView:
    """One display frame of a drive.

    Attributes:
        pose: of the car, between two control steps as the display runs faster than the control.
        road_wheel_rad: angle of the front wheels, seen in the chase view only.
        elapsed_s: since the attempt's start.
        number, count: this drive is the ``number``-th (from 1) of ``count``.
        needle: the participant's own wheel in [-2.5, 2.5]; None while unknown.
        agent_needle: the robot's wheel, where the protocol shows it; it may anchor labels.
        instruction: one line.
        balls: balls reached so far, in a practice drive; None elsewhere.
        speed_mps: of the car, forward.
        outcome: how the drive has ended, if it has.
    """

    pose: Pose2D
    road_wheel_rad: float = 0.0
    elapsed_s: float
    number: int
    count: int
    needle: float | None
    agent_needle: float | None = None
    device: str
    device_ok: bool = True
    recording: bool = True
    instruction: str = ""
    balls: int | None = None
    teacher_drives: bool = False
    speed_mps: float = 0.0
    outcome: Outcome = Outcome.RUNNING


@dataclass(frozen=True, kw_only=True, slots=True)
class Page:
    """A still page: countdown, pause, between two drives, the steps of the wheel wizard, the end.

    Attributes:
        big: a few letters shown large, such as the countdown's digit.
        lines: text, a paragraph each.
        keys: what can be pressed and what it does, such as ``("Space", "start")``.
        needle: the wheel in [-2.5, 2.5], with ``centre_band`` as the part that counts as centred.
        bars: named values in [0, 1], such as pedals.
        done, count: pips, such as drives done.
        over_drive: drawn over the dimmed drive instead of on plain ground.
    """

    title: str
    big: str = ""
    lines: Sequence[str] = ()
    keys: Sequence[tuple[str, str]] = ()
    tone: Literal["neutral", "good", "warning", "error"] = "neutral"
    needle: float | None = None
    centre_band: float | None = None
    bars: Sequence[tuple[str, float | None]] = ()
    done: int = 0
    count: int = 0
    over_drive: bool = False


class Screen(Protocol):
    """A place that shows drives and pages."""

    @property
    def focused(self) -> bool:
        """The window has the keyboard's focus."""
        ...

    def acts(self) -> list[Act]:
        """What was asked for since the last call; the event queue must have been polled."""
        ...

    def press(self, act: Act) -> None:
        """Take ``act`` as if its key had been pressed: by a button of the wheel."""
        ...

    def enter(self, world: WorldSpec) -> None:
        """Prepare to show drives in ``world``; slow (it builds a scene), so not during a drive."""
        ...

    def show_drive(self, view: DriveView) -> None:
        """Draw one frame of a drive and put it on the display."""
        ...

    def show_page(self, page: Page) -> None:
        """Draw a page and put it on the display."""
        ...
