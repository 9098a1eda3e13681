"""Looks after a drive that a person takes part in: keys, buttons, focus and the device."""

from steerlab.teleop.devices.contract import Button, DeviceSample
from steerlab.teleop.loop import DriveEnd
from steerlab.teleop.screen.contract import Act, Screen

_ENDS = {  # the first that applies counts
    Act.STOP: DriveEnd.STOPPED,
    Act.FOCUS_LOST: DriveEnd.FOCUS_LOST,
    Act.REDO: DriveEnd.REDO,
    Act.PAUSE: DriveEnd.PAUSED,
}


class PersonWatch:
    """Ends a drive when it must not go on.

    A button counts when it goes down, so that one still held from before does nothing.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._held: frozenset[Button] = frozenset()

    def begin(self, sample: DeviceSample) -> None:
        """An attempt starts: forget what was pressed before."""
        self._screen.acts()
        self._held = sample.buttons

    @property
    def focused(self) -> bool:
        """The window has the keyboard's focus."""
        return self._screen.focused

    def interruption(self, sample: DeviceSample) -> DriveEnd | None:
        """Why the drive must not go on with this sample; None while it may."""
        pressed = self._pressed(sample)
        acts = self._screen.acts()
        for act, end in _ENDS.items():
            if act in acts:
                return end
        if not self._screen.focused:
            return DriveEnd.FOCUS_LOST
        if not sample.ok or sample.wheel is None:
            return DriveEnd.DEVICE_LOST
        if Button.PAUSE in pressed:
            return DriveEnd.PAUSED
        return None

    def acts(self, sample: DeviceSample) -> list[Act]:
        """What was asked for on a page; on the wheel, pause goes on and redo does it again."""
        pressed = self._pressed(sample)
        acts = self._screen.acts()
        if Button.PAUSE in pressed:
            acts.append(Act.CONFIRM)
        return acts

    def _pressed(self, sample: DeviceSample) -> frozenset[Button]:
        """Buttons that went down just now; redo is asked for once more, as its key is."""
        pressed = sample.buttons - self._held
        self._held = sample.buttons
        if Button.REDO in pressed:
            self._screen.press(Act.REDO)
        return pressed
