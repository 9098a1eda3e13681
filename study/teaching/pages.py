"""The pages that a person sees in a teaching phase."""

from collections.abc import Sequence

from steerlab.sim.language import said
from steerlab.sim.rollout import Outcome
from steerlab.teleop.pages import (
    AGAIN,
    GO_ON,
    OUTCOMES,
    STOP,
    next_lines,
    page_keys,
    rollout_done,
    untimely,
)
from steerlab.teleop.screen.contract import Page


def before_page(title: str, lines: Sequence[str], done: int, count: int) -> Page:
    """Tells the person what to do from now on."""
    return Page(
        title=title,
        lines=[said(line) for line in lines],
        keys=page_keys(GO_ON, STOP),
        done=done,
        count=count,
    )


def button_page(device: str, done: int, count: int) -> Page:
    """The person tries the take-over button: the condition needs one that works."""
    return Page(
        title=said("Try the take-over button"),
        lines=(
            said("Press it once, to go on."),
            said(
                "If nothing happens, tell the experimenter: {device} may have no button for it yet."
            ).format(device=device),
        ),
        keys=page_keys(STOP),
        done=done,
        count=count,
    )


def try_again_page(outcome: Outcome, left: int, count: int) -> Page:
    """The first drive did not reach the ball."""
    tries = said("You have one more try.") if left == 1 else said("You have {left} more tries.")
    return Page(
        title=said("Not yet at the ball"),
        lines=(
            said(OUTCOMES[outcome]),
            said(
                "The robot learns from a drive that reaches it, so please try again. It need not "
                "be perfect."
            ),
            tries.format(left=left),
        ),
        keys=page_keys(GO_ON, STOP),
        tone="warning",
        count=count,
    )


def learning_page(number: int, count: int, outcome: Outcome, share: float) -> Page:
    """Shown while the robot learns and the person rests."""
    return Page(
        title=rollout_done(number, count),
        lines=(said(OUTCOMES[outcome]), said("Rest your hands while the robot learns from it.")),
        bars=((said("Learning"), share),),
        keys=page_keys(AGAIN, STOP),
        done=number,
        count=count,
    )


def learnt_page(number: int, count: int, outcome: Outcome, after: str = "") -> Page:
    """The robot has learnt; the person goes on when they like."""
    learnt = said("The robot has learnt from it. Go on when your hands are rested.")
    if number == count:
        learnt = said("The robot has learnt from it. That was the last one.")
    return Page(
        title=rollout_done(number, count),
        lines=(said(OUTCOMES[outcome]), learnt, *(next_lines(after) if number == count else ())),
        bars=((said("Learning"), 1.0),),
        keys=page_keys(GO_ON, AGAIN, STOP),
        tone="good" if outcome is Outcome.BALL_REACHED else "neutral",
        done=number,
        count=count,
    )


def untimely_page(number: int, count: int) -> Page:
    """The computer could not keep time; a redo is offered."""
    return Page(
        title=rollout_done(number, count),
        lines=(untimely(),),
        keys=page_keys(AGAIN, GO_ON, STOP),
        tone="warning",
        done=number - 1,
        count=count,
    )


def waiting_page(what: str, share: float) -> Page:
    """Shown while something takes a few seconds."""
    return Page(
        title=said("One moment"),
        lines=(f"{said(what)}.",),
        bars=((said("Done"), share),),
        keys=page_keys(STOP),
    )


def preparing_page() -> Page:
    """Shown while world and robot are made ready."""
    return Page(title=said("One moment"), lines=(said("The robot is made ready."),))
