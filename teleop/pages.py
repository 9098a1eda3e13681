"""The words of a session's pages."""

from collections.abc import Sequence
from math import ceil

from steerlab.sim.rollout import Outcome
from steerlab.teleop.devices.contract import DeviceSample
from steerlab.teleop.loop import DriveEnd
from steerlab.teleop.screen.contract import Page
from steerlab.teleop.timing_limits import TimingViolation

CENTRED = 0.15  # wheel units: 6 % of the way to full lock
_GO_ON = ("Space", "go on")
_STOP = ("Esc", "stop; what is done stays done")

_OUTCOMES = {
    Outcome.BALL_REACHED: "The car reached the ball.",
    Outcome.BLOCK_HIT: "The car hit a block.",
    Outcome.OUT_OF_BOUNDS: "The car left the ground.",
    Outcome.TIME_LIMIT: "The time was up.",
    Outcome.RUNNING: "The drive is not over.",
}
_PAUSES = {
    DriveEnd.PAUSED: "You paused the drive.",
    DriveEnd.FOCUS_LOST: "The window lost the focus, so the wheel was not heard any more.",
    DriveEnd.DEVICE_LOST: "The device was lost.",
}


def countdown_page(
    number: int,
    count: int,
    sample: DeviceSample,
    *,
    left_s: float,
    centred: bool,
    focused: bool,
    device: str,
    what: str = "Rollout",
) -> Page:
    """Counts down while the wheel is centred; says what is missing while it is not."""
    if not sample.ok or sample.wheel is None:
        big, line = "", f"{device} has not been heard yet. Move it a little."
    elif not focused:
        big, line = "", "Click on this window."
    elif not centred:
        big, line = "", "Centre the wheel to start."
    else:
        big, line = str(ceil(left_s)), "Keep the wheel centred."
    return Page(
        title=f"{what} {number} of {count}",
        big=big,
        lines=(line,),
        keys=(_STOP,),
        needle=sample.wheel if sample.ok else None,
        centre_band=CENTRED,
        done=number - 1,
        count=count,
        over_drive=True,
    )


def pause_page(why: DriveEnd, sample: DeviceSample, device: str, *, focused: bool) -> Page:
    """Says why, what must be mended first, and that the drive starts over."""
    lines = [_PAUSES[why]]
    ready = True
    if not sample.ok or sample.wheel is None:
        ready = False
        lines.append(f"Waiting for {device}: plug it in again and move it once.")
    if not focused:
        ready = False
        lines.append("Click on this window.")
    lines.append("This drive will start again from the beginning; nothing else is lost.")
    return Page(
        title="Pause",
        lines=lines,
        keys=(_GO_ON, _STOP) if ready else (_STOP,),
        tone="neutral" if ready else "warning",
        needle=sample.wheel if sample.ok else None,
    )


def drive_done_page(
    outcome: Outcome, failed: Sequence[TimingViolation], number: int, count: int
) -> Page:
    """Between two drives; says so if the computer could not keep time."""
    lines = [_OUTCOMES[outcome]]
    if failed:
        lines.append(
            "The computer could not keep time in this drive: "
            + "; ".join(map(str, failed))
            + ". Please do it again."
        )
    return Page(
        title=f"Rollout {number} of {count} is done",
        lines=lines,
        keys=(_GO_ON, ("R", "do this rollout again"), _STOP),
        tone="warning" if failed else "good",
        done=number,
        count=count,
    )


def session_done_page(count: int) -> Page:
    """The end."""
    return Page(
        title="Thank you",
        lines=(f"All {count} rollouts are done, and everything is kept.",),
        keys=(("Space", "close"),),
        tone="good",
        done=count,
        count=count,
    )


def keeping_page() -> Page:
    """While recordings are written; a minute at most."""
    return Page(title="Thank you", lines=("Writing the recordings. The window closes by itself.",))


def pedals_page(sample: DeviceSample, device: str) -> Page:
    """Before a practice drive, while a pedal has said nothing yet."""
    return Page(
        title="Press each pedal once",
        lines=(
            f"A pedal of {device} is known only after it has moved.",
            "If there are none, stop here and drive at cruise speed (--no-pedals).",
        ),
        keys=(("Esc", "stop practising"),),
        bars=(("throttle", sample.throttle), ("brake", sample.brake)),
    )


def practice_page(outcome: Outcome, balls: int, count: int) -> Page:
    """Between two practice drives."""
    return Page(
        title=f"{balls} of {count} balls",
        lines=(_OUTCOMES[outcome],),
        keys=(_GO_ON, ("Esc", "stop practising")),
        tone="good" if outcome is Outcome.BALL_REACHED else "neutral",
        done=balls,
        count=count,
    )


def practice_done_page(balls: int, crashes: int) -> Page:
    """The end of practice."""
    return Page(
        title="Well driven",
        lines=(f"Balls reached: {balls}. Blocks hit on the way: {crashes}.",),
        keys=(("Space", "close"),),
        tone="good",
        done=balls,
        count=balls,
    )


def error_page(text: str) -> Page:
    """Something went wrong; shown until the window closes."""
    return Page(
        title="The session had to stop",
        lines=(text, "Every drive that was finished is kept."),
        tone="error",
    )
