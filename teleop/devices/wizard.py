"""Runs the calibration wizard on a screen, and keeps what it measured."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter_ns, sleep

from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.calibration import (
    BUTTONS,
    PEDALS,
    STAGES,
    WheelCalibration,
    WizardStage,
)
from steerlab.teleop.devices.joystick import RawJoystick
from steerlab.teleop.devices.measuring import WizardConfig
from steerlab.teleop.devices.profile import this_system
from steerlab.teleop.devices.profile_folder import check_profile_folder, save_profile
from steerlab.teleop.screen.contract import Act, Page, Screen
from steerlab.teleop.sdl import SdlEvents

_FRAME_NS = 1_000_000_000 // 30
_POLL_S = 0.001  # as in a drive, so that rate and resolution are those a drive gets
_SPACE = ("Space", "go on")
_OVER = ("R", "start over")
_STOP = ("Esc", "stop")
_TEXT: dict[WizardStage, Sequence[str]] = {
    WizardStage.HANDS_OFF: ("Take your hands off the wheel and your feet off the pedals.",),
    WizardStage.LEFT: (
        "Turn the wheel all the way to the left.",
        "Hold it there and press Space.",
    ),
    WizardStage.RIGHT: (
        "Turn the wheel all the way to the right.",
        "Hold it there and press Space.",
    ),
    WizardStage.LET_GO: (
        "Let the wheel return to the centre, or put it straight.",
        "Take your hands off and press Space.",
    ),
    WizardStage.PAUSE: ("Press the button on the wheel that shall pause a drive.",),
    WizardStage.REDO: ("Press the button on the wheel that shall redo a drive.",),
    WizardStage.TAKE_OVER: (
        "Press the button on the wheel that, held down, shall take over from the robot.",
    ),
    WizardStage.CHECK: (
        "Turn all the way to both sides, press each pedal, and let the wheel go.",
        "The needle must reach both ends and return to the middle.",
    ),
}
_MOMENTS = ("Press it all the way down", "Release it", "Press it once more", "Release it again")


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
    check_profile_folder(folder)
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


def wizard_page(wizard: WheelCalibration) -> Page:
    """The page for the wizard's current stage."""
    if wizard.finished:
        return Page(title="The wheel is calibrated", tone="good")
    lines = list(_lines(wizard))
    if wizard.problem:
        lines.insert(0, wizard.problem)
    checking = wizard.checked
    return Page(
        title=f"Calibrating {wizard.joystick.name}: {wizard.stage}",
        big="..." if wizard.measuring else "",
        lines=lines,
        keys=_keys(wizard),
        tone="warning" if wizard.problem else "neutral",
        needle=_needle(wizard),
        centre_band=wizard.config.centre_band if checking is not None else None,
        bars=_bars(wizard),
        done=STAGES.index(wizard.stage),
        count=len(STAGES) - 1,
    )


def _lines(wizard: WheelCalibration) -> Sequence[str]:
    if wizard.measuring:
        return ("Measuring. Leave everything alone.",)
    if wizard.stage in PEDALS:
        moment = _MOMENTS[len(wizard.pedal_moments)]
        return (f"The {wizard.stage}. {moment}, and press Space.",)
    if wizard.stage is not WizardStage.CHECK:
        return _TEXT[wizard.stage]
    low, high = wizard.reached
    lines = [*_TEXT[WizardStage.CHECK], f"Reached {high:+.2f} left and {low:+.2f} right."]
    if wizard.profile is not None and (measured := wizard.profile.measured) is not None:
        lines.append(
            f"Released wheel: returns within {measured.return_error:.3f}, noise "
            f"{measured.noise:.4f}. Steps of {measured.resolution:.4f}, {measured.rate_hz:.0f} "
            "events a second."
        )
    return lines


def _keys(wizard: WheelCalibration) -> list[tuple[str, str]]:
    if wizard.measuring:
        return [_STOP]
    keys: list[tuple[str, str]] = [] if wizard.stage in BUTTONS else [_SPACE]
    if wizard.stage in PEDALS:
        keys.append(("P", "there is no such pedal"))
    if wizard.stage in BUTTONS:
        keys.append(("P", "use no button for this"))
    if wizard.stage is WizardStage.CHECK:
        keys = [("Space", "keep")]
    return [*keys, _OVER, _STOP]


def _needle(wizard: WheelCalibration) -> float | None:
    """The wheel's position by the new profile, else by its two ends; None if unknown."""
    if wizard.checked is not None:
        return wizard.checked.wheel
    if wizard.ends is None or wizard.sample.lost:
        return None
    raw, ends = wizard.sample.axes[wizard.ends.axis], wizard.ends
    if raw is None:
        return None
    share = (raw - ends.right) / (ends.left - ends.right)
    return WHEEL_LIMIT * (2.0 * min(1.0, max(0.0, share)) - 1.0)


def _bars(wizard: WheelCalibration) -> list[tuple[str, float | None]]:
    """Pedals once they are known, else every raw axis, so that any motion is seen at once."""
    profile, checked = wizard.profile, wizard.checked
    if profile is None or checked is None:
        return [
            (f"axis {number}", None if value is None else (value + 1.0) / 2.0)
            for number, value in enumerate(wizard.sample.axes)
        ]
    pedals = {"throttle": (profile.throttle, checked.throttle)}
    pedals["brake"] = (profile.brake, checked.brake)
    return [(name, amount) for name, (pedal, amount) in pedals.items() if pedal is not None]
