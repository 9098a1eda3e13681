"""The pages that a person sees in a teaching phase."""

from collections.abc import Sequence

from steerlab.sim.rollout import Outcome
from steerlab.teleop.screen.contract import Page
from steerlab.teleop.timing_limits import TimingViolation

_GO_ON = ("Space", "go on")
_AGAIN = ("R", "do this rollout again")
_STOP = ("Esc", "stop; what is done stays done")
_OUTCOMES = {
    Outcome.BALL_REACHED: "The car reached the ball.",
    Outcome.BLOCK_HIT: "The car hit a block.",
    Outcome.OUT_OF_BOUNDS: "The car left the ground.",
    Outcome.TIME_LIMIT: "The time was up.",
}


def before_page(title: str, lines: Sequence[str], done: int, count: int) -> Page:
    """Tells the person what to do from now on."""
    return Page(title=title, lines=lines, keys=(_GO_ON, _STOP), done=done, count=count)


def button_page(device: str, done: int, count: int) -> Page:
    """The person tries the take-over button: the condition needs one that works."""
    return Page(
        title="Try the take-over button",
        lines=(
            "Press it once, to go on.",
            f"If nothing happens, tell the experimenter: {device} may have no button for it yet.",
        ),
        keys=(_STOP,),
        done=done,
        count=count,
    )


def try_again_page(outcome: Outcome, left: int, count: int) -> Page:
    """The first drive did not reach the ball."""
    tries = "one more try" if left == 1 else f"{left} more tries"
    return Page(
        title="Not yet at the ball",
        lines=(
            _OUTCOMES[outcome],
            "The robot learns from a drive that reaches it, so please try again. It need not be "
            f"perfect; you have {tries}.",
        ),
        keys=(_GO_ON, _STOP),
        tone="warning",
        count=count,
    )


def learning_page(number: int, count: int, outcome: Outcome, share: float) -> Page:
    """Shown while the robot learns and the person rests."""
    return Page(
        title=f"Rollout {number} of {count} is done",
        lines=(_OUTCOMES[outcome], "Rest your hands while the robot learns from it."),
        bars=(("Learning", share),),
        keys=(_AGAIN, _STOP),
        done=number,
        count=count,
    )


def learnt_page(number: int, count: int, outcome: Outcome) -> Page:
    """The robot has learnt; the person goes on when they like."""
    lines = [_OUTCOMES[outcome], "The robot has learnt from it. Go on when your hands are rested."]
    if number == count:
        lines[1] = "The robot has learnt from it. That was the last one."
    return Page(
        title=f"Rollout {number} of {count} is done",
        lines=lines,
        bars=(("Learning", 1.0),),
        keys=(_GO_ON, _AGAIN, _STOP),
        tone="good",
        done=number,
        count=count,
    )


def untimely_page(failed: Sequence[TimingViolation], number: int, count: int) -> Page:
    """The computer could not keep time; a redo is offered."""
    what = "; ".join(map(str, failed))
    return Page(
        title=f"Rollout {number} of {count} is done",
        lines=(f"The computer could not keep time in this drive: {what}. Please do it again.",),
        keys=(_AGAIN, _GO_ON, _STOP),
        tone="warning",
        done=number - 1,
        count=count,
    )


def waiting_page(what: str, share: float) -> Page:
    """Shown while something takes a few seconds."""
    return Page(title="One moment", lines=(f"{what}.",), bars=(("Done", share),), keys=(_STOP,))


def preparing_page() -> Page:
    """Shown while world and robot are made ready."""
    return Page(title="One moment", lines=("The robot is made ready.",))
