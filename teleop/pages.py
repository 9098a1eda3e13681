"""The words of a session's pages."""

from collections.abc import Sequence
from math import ceil
from typing import Literal

from steerlab.sim.language import said
from steerlab.sim.rollout import Outcome
from steerlab.teleop.devices.contract import DeviceSample
from steerlab.teleop.loop import DriveEnd
from steerlab.teleop.screen.contract import Page
from steerlab.teleop.timing_limits import TimingViolation

CENTRED = 0.15  # wheel units: 6 % of the way to full lock
GO_ON = ("Space", "go on")
AGAIN = ("R", "do this rollout again")
STOP = ("Esc", "stop; what is done stays done")
_CLOSE = ("Space", "close")
_STOP_PRACTISING = ("Esc", "stop practising")
ROLLOUT, BALL = "Rollout {number} of {count}", "Ball {number} of {count}"
OUTCOMES = {
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


def page_keys(*keys: tuple[str, str]) -> tuple[tuple[str, str], ...]:
    """Keys and what they do, in the language that is spoken."""
    return tuple((key, said(does)) for key, does in keys)


def rollout_done(number: int, count: int) -> str:
    """A title."""
    return said("Rollout {number} of {count} is done").format(number=number, count=count)


def untimely() -> str:
    """Why a drive is to be done again; the experimenter is told which limits it broke."""
    return said("The computer could not keep time in this drive. Please do it again.")


def next_lines(after: str) -> tuple[str, ...]:
    """Sends the person back to their page, where ``after`` comes next; none if nothing does."""
    if not after:
        return ()
    words = said("Please go back to your page, on the tablet or behind this window.")
    return words, said("Next comes: {title}.").format(title=after)


def countdown_page(
    number: int,
    count: int,
    sample: DeviceSample,
    *,
    left_s: float,
    centred: bool,
    focused: bool,
    device: str,
    what: str = ROLLOUT,
) -> Page:
    """Counts down while the wheel is centred; says what is missing while it is not."""
    if not sample.ok or sample.wheel is None:
        line = said("{device} has not been heard yet. Move it a little.").format(device=device)
        big = ""
    elif not focused:
        big, line = "", said("Click on this window.")
    elif not centred:
        big, line = "", said("Centre the wheel to start.")
    else:
        big, line = str(ceil(left_s)), said("Keep the wheel centred.")
    return Page(
        title=said(what).format(number=number, count=count),
        big=big,
        lines=(line,),
        keys=page_keys(STOP),
        needle=sample.wheel if sample.ok else None,
        centre_band=CENTRED,
        done=number - 1,
        count=count,
        over_drive=True,
    )


def pause_page(why: DriveEnd, sample: DeviceSample, device: str, *, focused: bool) -> Page:
    """Says why, what must be mended first, and that the drive starts over."""
    lines = [said(_PAUSES[why])]
    ready = True
    if not sample.ok or sample.wheel is None:
        ready = False
        again = said("Waiting for {device}: plug it in again and move it once.")
        lines.append(again.format(device=device))
    if not focused:
        ready = False
        lines.append(said("Click on this window."))
    lines.append(said("This drive will start again from the beginning; nothing else is lost."))
    return Page(
        title=said("Pause"),
        lines=lines,
        keys=page_keys(GO_ON, STOP) if ready else page_keys(STOP),
        tone="neutral" if ready else "warning",
        needle=sample.wheel if sample.ok else None,
    )


def drive_done_page(
    outcome: Outcome, failed: Sequence[TimingViolation], number: int, count: int
) -> Page:
    """Between two drives; says so if the computer could not keep time."""
    lines = [said(OUTCOMES[outcome])]
    if failed:
        lines.append(untimely())
    return Page(
        title=rollout_done(number, count),
        lines=lines,
        keys=page_keys(GO_ON, AGAIN, STOP),
        tone="warning" if failed else _tone(outcome),
        done=number,
        count=count,
    )


def _tone(outcome: Outcome) -> Literal["good", "neutral"]:
    """No tick over a block that was hit."""
    return "good" if outcome is Outcome.BALL_REACHED else "neutral"


def session_done_page(count: int, after: str = "") -> Page:
    """The end of all drives; thanks come where nothing follows."""
    done = said("All {count} rollouts are done, and everything is kept.").format(count=count)
    return Page(
        title=said("This part is done") if after else said("Thank you"),
        lines=(done, *next_lines(after)),
        keys=page_keys(_CLOSE),
        tone="good",
        done=count,
        count=count,
    )


def keeping_page() -> Page:
    """While recordings are written; a minute at most."""
    line = said("Writing the recordings. The window closes by itself.")
    return Page(title=said("One moment"), lines=(line,))


def pedals_page(sample: DeviceSample, device: str) -> Page:
    """Before a practice drive, while a pedal has said nothing yet."""
    return Page(
        title=said("Press each pedal once"),
        lines=(
            said("A pedal of {device} is known only after it has moved.").format(device=device),
            said("If there are none, stop here and tell the experimenter."),
        ),
        keys=page_keys(_STOP_PRACTISING),
        bars=((said("throttle"), sample.throttle), (said("brake"), sample.brake)),
    )


def practice_page(outcome: Outcome, balls: int, count: int) -> Page:
    """Between two practice drives."""
    return Page(
        title=said("{balls} of {count} balls").format(balls=balls, count=count),
        lines=(said(OUTCOMES[outcome]),),
        keys=page_keys(GO_ON, _STOP_PRACTISING),
        tone=_tone(outcome),
        done=balls,
        count=count,
    )


def practice_done_page(balls: int, crashes: int, after: str = "") -> Page:
    """The end of practice."""
    return Page(
        title=said("Well driven"),
        lines=(
            said("Balls reached: {balls}. Blocks hit on the way: {crashes}.").format(
                balls=balls, crashes=crashes
            ),
            *next_lines(after),
        ),
        keys=page_keys(_CLOSE),
        tone="good",
        done=balls,
        count=balls,
    )


def error_page(text: str) -> Page:
    """Something went wrong; shown until the window closes."""
    return Page(
        title=said("The session had to stop"),
        lines=(text, said("Every drive that was finished is kept.")),
        tone="error",
    )
