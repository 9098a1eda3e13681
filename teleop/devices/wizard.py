"""Runs the calibration wizard on a screen, and keeps what it found."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns, sleep

from steerlab.teleop.devices.calibration import WheelCalibration
from steerlab.teleop.devices.joystick import RawJoystick
from steerlab.teleop.devices.measuring import WizardConfig
from steerlab.teleop.devices.profile import this_system
from steerlab.teleop.devices.profile_folder import save_profile
from steerlab.teleop.devices.wizard_pages import wizard_page
from steerlab.teleop.screen.contract import Act, Screen
from steerlab.teleop.sdl import SdlEvents

_FRAME_NS = 1_000_000_000 // 30
_POLL_S = 0.001  # as in a drive, so that rate and resolution are those a drive gets


def run_wizard(
    screen: Screen,
    events: SdlEvents,
    joystick: RawJoystick,
    *,
    name: str = "",
    folder: Path | None = None,
    config: WizardConfig | None = None,
    system: str | None = None,
    now_ns: Callable[[], int] = perf_counter_ns,
    sleep_s: Callable[[float], None] = sleep,
) -> Path | None:
    """Lead a person through the calibration of an open joystick.

    Args:
        name: what to call the wheel; the joystick's own name by default.
        folder: where profiles are kept; the user's own by default.

    Returns:
        The profile's file; None if the person stopped, and then nothing is kept.

    Raises:
        SteerlabError: the profile cannot be written.
    """
    wizard = WheelCalibration(
        joystick.info, system=system or this_system(), name=name, config=config
    )
    keys = {Act.CONFIRM: wizard.confirm, Act.PAUSE: wizard.skip, Act.REDO: wizard.again}
    shown_ns: int | None = None
    while not wizard.finished:
        events.poll()
        time_ns = now_ns()
        wizard.advance(joystick.raw(), time_ns)
        for act in screen.acts():
            if act is Act.STOP:
                return None
            if act in keys:
                keys[act]()
        if shown_ns is None or time_ns - shown_ns >= _FRAME_NS:
            screen.show_page(wizard_page(wizard))
            shown_ns = time_ns
        sleep_s(_POLL_S)
    assert wizard.profile is not None, "a finished wizard has a profile"
    path = save_profile(wizard.profile, folder)
    screen.show_page(wizard_page(wizard))
    return path
