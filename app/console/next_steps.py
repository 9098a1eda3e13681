"""What the experimenter does next for a participant, in plain words."""

from dataclasses import dataclass
from enum import Enum, auto

from steerlab.app.console import texts
from steerlab.app.console.wheel_run import RunView, WheelRuns
from steerlab.study.contract import PAGES, ParticipantView, Phase, PhaseKind, PhaseState, Standing


class NextAction(Enum):
    """What the button of a next step does."""

    NONE = auto()
    LINK = auto()
    START = auto()
    RESUME = auto()
    ERASE = auto()


class AtWheel(Enum):
    """What is known of the participant's next phase, at the wheel or of the computer's own."""

    READY = auto()
    RUNNING = auto()
    STOPPED = auto()  # it was started here, has ended, and the phase has not
    BEGUN = auto()  # and whether it goes on is unknown: another program has started it


def at_wheel(view: ParticipantView, phase: Phase, runs: WheelRuns) -> AtWheel:
    """How it stands with ``phase``, which is next for the participant."""
    run = runs.view()
    if run is not None and run.goes_on and (run.participant, run.phase) == (view.id, phase.id):
        return AtWheel.RUNNING
    if runs.tried(view.id, phase.id):
        return AtWheel.STOPPED
    begun = state_of(view, phase.id) is PhaseState.STARTED
    return AtWheel.BEGUN if begun else AtWheel.READY


@dataclass(frozen=True, kw_only=True, slots=True)
class NextStep:
    """One participant's next step.

    Attributes:
        phase: what a start or resume button is for.
        stopped: what was going on ended before its time, and somebody must look.
    """

    text: str
    act: NextAction = NextAction.NONE
    phase: Phase | None = None
    stopped: bool = False

    @property
    def needs_experimenter(self) -> bool:
        """Whether the participant waits for the experimenter."""
        return self.act is not NextAction.NONE


def next_step(view: ParticipantView, runs: WheelRuns) -> NextStep:
    """What to do next, given what is at the wheel, of this participant or another."""
    phase, run = view.next_phase, runs.view()
    if phase is None:
        later = view.id in runs.to_erase
        return NextStep(text=texts.NEXT_ERASE_LATER) if later else _without_phase(view, run)
    if phase.kind in PAGES:
        if view.standing is Standing.ENROLLED:
            return NextStep(text=texts.NEXT_LINK, act=NextAction.LINK)
        return NextStep(text=texts.NEXT_PAGE.format(title=phase.title))
    alone = phase.kind is PhaseKind.CALIBRATE_W
    how = at_wheel(view, phase, runs)
    if how is AtWheel.RUNNING:
        words = texts.NEXT_COMPUTING if alone else texts.NEXT_RUNNING
        return NextStep(text=words.format(title=phase.title))
    if how is AtWheel.STOPPED:
        said = texts.NEXT_STOPPED.format(title=phase.title)
        return NextStep(text=said, act=NextAction.RESUME, phase=phase, stopped=True)
    if alone and how is AtWheel.READY:
        return NextStep(text=texts.NEXT_BY_ITSELF.format(title=phase.title))
    if run is not None and run.goes_on:
        return NextStep(text=texts.NEXT_OTHER_RUNS.format(participant=run.participant))
    if how is AtWheel.BEGUN:
        said = texts.NEXT_RESUME.format(title=phase.title)
        return NextStep(text=said, act=NextAction.RESUME, phase=phase)
    said = texts.NEXT_START.format(title=phase.title)
    return NextStep(text=said, act=NextAction.START, phase=phase)


def state_of(view: ParticipantView, phase: str) -> PhaseState | None:
    """The state of a phase, by id; None if the participant does not have it."""
    return next((state for known, state in view.phases if known.id == phase), None)


def step_of(view: ParticipantView) -> tuple[int, int]:
    """The participant's step, from 1, and how many there are; the last one when all are done."""
    done = sum(state.over for _, state in view.phases)
    return min(done + 1, len(view.phases)), len(view.phases)


def _without_phase(view: ParticipantView, run: RunView | None) -> NextStep:
    if view.standing is Standing.ERASING:
        if run is not None and run.goes_on and run.participant == view.id:
            return NextStep(text=texts.NEXT_ERASING)
        return NextStep(text=texts.NEXT_ERASE, act=NextAction.ERASE)
    if view.standing is Standing.DECLINED:
        return NextStep(text=texts.NEXT_DECLINED)
    return NextStep(text=texts.NEXT_LEFT if view.standing.withdrawn else texts.NEXT_FINISHED)
