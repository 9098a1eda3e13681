"""What the experimenter does next for a participant, in plain words."""

from dataclasses import dataclass
from enum import Enum, auto

from steerlab.app.console import texts
from steerlab.app.console.wheel_run import RunView
from steerlab.study.contract import ParticipantView, Phase, PhaseKind, PhaseState, Standing

PAGES = frozenset(
    {PhaseKind.CONSENT, PhaseKind.QUESTIONNAIRES, PhaseKind.INSTRUCTIONS, PhaseKind.DEBRIEF}
)
OVER = frozenset({PhaseState.DONE, PhaseState.SKIPPED})


class NextAction(Enum):
    """What the button of a next step does."""

    NONE = auto()
    LINK = auto()
    START = auto()
    RESUME = auto()
    ERASE = auto()


@dataclass(frozen=True, kw_only=True, slots=True)
class NextStep:
    """One participant's next step; ``phase`` is what a start or resume button is for."""

    text: str
    act: NextAction = NextAction.NONE
    phase: Phase | None = None

    @property
    def needs_experimenter(self) -> bool:
        """Whether the participant waits for the experimenter."""
        return self.act is not NextAction.NONE


def next_step(view: ParticipantView, run: RunView | None) -> NextStep:
    """What to do next, given the run that is at the wheel, of this participant or another."""
    phase = view.next_phase
    if phase is None:
        return _without_phase(view, run)
    if phase.kind in PAGES:
        if view.standing is Standing.ENROLLED:
            return NextStep(text=texts.NEXT_LINK, act=NextAction.LINK)
        return NextStep(text=texts.NEXT_PAGE.format(title=phase.title))
    if run is not None and run.goes_on:
        if (run.participant, run.phase) == (view.id, phase.id):
            alone = phase.kind is PhaseKind.CALIBRATE_W
            words = texts.NEXT_COMPUTING if alone else texts.NEXT_RUNNING
            return NextStep(text=words.format(title=phase.title))
        return NextStep(text=texts.NEXT_OTHER_RUNS.format(participant=run.participant))
    if state_of(view, phase.id) is PhaseState.STARTED:
        said = texts.NEXT_RESUME.format(title=phase.title)
        return NextStep(text=said, act=NextAction.RESUME, phase=phase)
    words = texts.NEXT_COMPUTE if phase.kind is PhaseKind.CALIBRATE_W else texts.NEXT_START
    return NextStep(text=words.format(title=phase.title), act=NextAction.START, phase=phase)


def state_of(view: ParticipantView, phase: str) -> PhaseState | None:
    """The state of a phase, by id; None if the participant does not have it."""
    return next((state for known, state in view.phases if known.id == phase), None)


def step_of(view: ParticipantView) -> tuple[int, int]:
    """The participant's step, from 1, and how many there are; the last one when all are done."""
    done = sum(state in OVER for _, state in view.phases)
    return min(done + 1, len(view.phases)), len(view.phases)


def _without_phase(view: ParticipantView, run: RunView | None) -> NextStep:
    if view.standing is Standing.ERASING:
        if run is not None and run.goes_on and run.participant == view.id:
            return NextStep(text=texts.NEXT_ERASING)
        return NextStep(text=texts.NEXT_ERASE, act=NextAction.ERASE)
    if view.standing is Standing.DECLINED:
        return NextStep(text=texts.NEXT_DECLINED)
    return NextStep(text=texts.NEXT_LEFT if view.standing.withdrawn else texts.NEXT_FINISHED)
