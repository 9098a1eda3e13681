"""Settings of the window."""

from dataclasses import dataclass, replace

from steerlab.sim.camera_config import MAX_SIDE_PX, CameraConfig, View
from steerlab.sim.errors import InvalidConfig

SMALLEST = (640, 360)
TEXT_SCALES = (0.8, 2.0)


@dataclass(frozen=True, kw_only=True)
class ScreenConfig:
    """Size, view and text scale of the window.

    Attributes:
        width, height: in pixels; a full screen takes the monitor's instead.
        monitor: number or name of the one to use; empty for the one that was chosen before.
        view: from behind the hood, from the car's front, or from behind it.
        text_scale: 0.8 to 2; 1 is made for 960x540, and grows with the window.
        frame_budget_ms: a frame that takes longer than this is drawn in fewer pixels; a display
            of 60 Hz leaves 16.7 ms, and input and recording want their part.
        sound: engine, contact, countdown; without a sound device it is silent, and says so.
    """

    width: int = 960
    height: int = 540
    full_screen: bool = False
    monitor: str = ""
    view: View = "driver"
    text_scale: float = 1.0
    frame_budget_ms: float = 12.0
    sound: bool = False

    def __post_init__(self) -> None:
        if not (
            SMALLEST[0] <= self.width <= MAX_SIDE_PX and SMALLEST[1] <= self.height <= MAX_SIDE_PX
        ):
            raise InvalidConfig(
                f"A window of {self.width}x{self.height}; give {SMALLEST[0]}x{SMALLEST[1]} to "
                f"{MAX_SIDE_PX}x{MAX_SIDE_PX}, such as 960x540 or 1280x720."
            )
        CameraConfig(view=self.view)
        low, high = TEXT_SCALES
        if not low <= self.text_scale <= high:
            raise InvalidConfig(f"text_scale is {self.text_scale}; give {low:g} to {high:g}.")
        if not self.frame_budget_ms > 0.0:
            raise InvalidConfig(f"frame_budget_ms is {self.frame_budget_ms}; must be positive.")


@dataclass(frozen=True, kw_only=True)
class WindowChoice:
    """What is chosen at the computer and not by a study's protocol; kept with each session.

    Attributes:
        monitor: number or name; empty for the one that was chosen before.
        windowed: in a window where a full screen is planned, to try something out.
        silent: no sound where sound is planned.
    """

    monitor: str = ""
    windowed: bool = False
    silent: bool = False

    def of(self, planned: ScreenConfig) -> ScreenConfig:
        """``planned`` with what was chosen."""
        return replace(
            planned,
            monitor=self.monitor,
            full_screen=planned.full_screen and not self.windowed,
            sound=planned.sound and not self.silent,
        )
