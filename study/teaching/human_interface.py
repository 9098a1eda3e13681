"""A person teaches before a window: countdown, drive, rest while the robot learns, and again."""

from collections.abc import Callable
from time import perf_counter_ns, sleep

from steerlab.learning.agents.drive import RoundDrive
from steerlab.learning.agents.teaching_contract import AfterRest, FinishedDrive, Work
from steerlab.sim.errors import SteerlabError
from steerlab.sim.progress import ShareProgress
from steerlab.sim.rollout import Outcome
from steerlab.study.teaching.conditions import TeacherAction, TeachingMode
from steerlab.study.teaching.live_round import make_live_round
from steerlab.study.teaching.pages import (
    before_page,
    button_page,
    learning_page,
    learnt_page,
    try_again_page,
    untimely_page,
    waiting_page,
)
from steerlab.study.teaching.teaching_log import outcome_event
from steerlab.teleop.attempt import AttemptLoop, Recorder, SessionConfig
from steerlab.teleop.devices.contract import Button, Device
from steerlab.teleop.pacing import NS_PER_S
from steerlab.teleop.page_prompt import with_buttons
from steerlab.teleop.pages import error_page
from steerlab.teleop.screen.contract import Act, Page, Screen
from steerlab.teleop.timing_limits import LoopHealth

PAGE_NS = NS_PER_S // 10  # while the robot learns: drawing takes time from it
_AFTER_REST = {Act.CONFIRM: AfterRest.GO_ON, Act.REDO: AfterRest.REDO, Act.STOP: AfterRest.STOP}


class _Pressed(Exception):
    """The person asked for something while work goes on; no error."""

    def __init__(self, act: Act) -> None:
        super().__init__(act.value)
        self.act = act


class HumanInterface:
    """Shows drives on ``screen``, which has entered the world, and records what the person does.

    Args:
        poll: empties the event queue.
        mode: how the condition is taught.
        title: of the phase.
        count: drives of the whole phase.
        now_ns, sleep_s: time itself; tests pass their own.

    Attributes:
        rests_ns: from the end of each drive until the person could go on.
    """

    def __init__(
        self,
        *,
        screen: Screen,
        device: Device,
        poll: Callable[[], None],
        recorder: Recorder,
        participant: str,
        mode: TeachingMode,
        title: str,
        count: int,
        config: SessionConfig,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self._screen, self._device, self._poll = screen, device, poll
        self._mode, self._title, self._count = mode, title, count
        self._now_ns = now_ns
        self._attempts = AttemptLoop(
            screen=screen,
            device=device,
            poll=poll,
            recorder=recorder,
            participant=participant,
            config=config,
            now_ns=now_ns,
            sleep_s=sleep_s,
        )
        self._after = config.after
        self._told: tuple[str, ...] = ()
        self._shown_ns = 0
        self.rests_ns: list[int] = []

    @property
    def health(self) -> list[LoopHealth]:
        """The loop's, one of each attempt finished here."""
        return self._attempts.health

    def drive(self, drive: RoundDrive) -> FinishedDrive | None:
        """Until an attempt is finished that the person wants to count; None to stop."""
        number = drive.number + 1
        if drive.failed is not None:
            page = try_again_page(drive.failed, drive.tries_left, self._count)
            if self._ask(page, Act.CONFIRM) is Act.STOP:
                return None
        live = make_live_round(drive, self._mode)
        if live.before != self._told:
            page = before_page(self._title, live.before, drive.number, self._count)
            if self._ask(page, Act.CONFIRM) is Act.STOP:
                return None
            if live.hands is TeacherAction.TAKE_OVER and not self._button_heard(drive.number):
                return None
            self._told = live.before

        def show(fraction: float) -> None:
            self._attempts.show_labelled(
                live.drive, fraction, number=number, count=self._count, instruction=live.during
            )

        while True:
            finished = self._attempts.until_finished(
                live.drive,
                show,
                number=number,
                count=self._count,
                event=lambda: outcome_event(live.drive.outcome),
            )
            if finished is None:
                return None
            if finished.failed:
                page = untimely_page(number, self._count)
                act = self._ask(page, Act.CONFIRM, Act.REDO)
                if act is Act.REDO:
                    continue
                if act is Act.STOP:
                    return None
            return live.finished(finished.attempt)

    def rest(self, number: int, outcome: Outcome, learn: Work, meanwhile: Work) -> AfterRest:
        """Show how far the robot has learnt; the person goes on only when it has."""
        about = number + 1, self._count, outcome
        learnt, began_ns = learnt_page(*about, self._after), self._now_ns()
        try:
            learn(self._ticker(lambda share: learning_page(*about, share), Act.REDO, Act.STOP))
            self.rests_ns.append(self._now_ns() - began_ns)
            meanwhile(self._ticker(lambda share: learnt, Act.CONFIRM, Act.REDO, Act.STOP))
        except _Pressed as pressed:
            return _AFTER_REST[pressed.act]
        except SteerlabError as error:
            self._screen.show_page(error_page(str(error)))
            raise
        return _AFTER_REST[self._ask(learnt, Act.CONFIRM, Act.REDO)]

    def wait(self, what: str, work: Work) -> bool:
        """Show how far it is; False to stop."""
        try:
            work(self._ticker(lambda share: waiting_page(what, share), Act.STOP))
        except _Pressed:
            return False
        return True

    def _ticker(self, page: Callable[[float], Page], *wanted: Act) -> ShareProgress:
        """Looks at keys and wheel, and draws now and then."""
        self._attempts.watch.begin(self._device.read())
        self._shown_ns = 0

        def tick(share: float) -> None:
            if self._now_ns() - self._shown_ns < PAGE_NS and share < 1.0:
                return
            self._poll()
            for act in self._attempts.watch.acts(self._device.read()):
                if act in wanted:
                    raise _Pressed(act)
            self._screen.show_page(with_buttons(page(share), self._device.info.buttons))
            self._shown_ns = self._now_ns()

        return tick

    def _button_heard(self, done: int) -> bool:
        """Wait for the take-over button; False to stop."""
        page = button_page(self._device.info.name, done, self._count)
        return self._attempts.prompt.until(
            lambda sample: page, lambda sample: Button.TAKE_OVER in sample.buttons
        )

    def _ask(self, page: Page, *wanted: Act) -> Act:
        return self._attempts.prompt.ask(lambda: page, {*wanted, Act.STOP})
