"""A person's session: drive after drive until all are done, each accepted or done again."""

from collections.abc import Callable, Iterable
from enum import StrEnum
from time import perf_counter_ns, sleep

from steerlab.teleop.attempt import AttemptLoop, Recorder, SessionConfig
from steerlab.teleop.devices.contract import Device
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.pages import drive_done_page, session_done_page
from steerlab.teleop.screen.contract import Act, Screen
from steerlab.teleop.timing_limits import LoopHealth


class SessionEnd(StrEnum):
    """How a session ended."""

    DONE = "all drives are done"
    STOPPED = "stopped; it goes on from here next time"


class DriveSession:
    """Shows drives on ``screen`` and records what the person at ``device`` does.

    Args:
        poll: empties the event queue.
        total, done: drives of the whole session, and how many of them were done before.
        now_ns, sleep_s: time itself; tests pass their own.

    Attributes:
        done: drives done so far.
    """

    def __init__(
        self,
        *,
        screen: Screen,
        device: Device,
        poll: Callable[[], None],
        recorder: Recorder,
        participant: str,
        total: int,
        done: int = 0,
        config: SessionConfig | None = None,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self._screen = screen
        self._instruction = (config or SessionConfig()).instruction
        self._after = (config or SessionConfig()).after
        self._total = total
        self.done = done
        self._attempts = AttemptLoop(
            screen=screen,
            device=device,
            poll=poll,
            recorder=recorder,
            participant=participant,
            config=config or SessionConfig(),
            now_ns=now_ns,
            sleep_s=sleep_s,
        )

    @property
    def health(self) -> list[LoopHealth]:
        """The loop's, one of each attempt finished in this session."""
        return self._attempts.health

    def run(self, drives: Iterable[Drive]) -> SessionEnd:
        """Show each drive until it has a finished attempt that the person accepts.

        Raises:
            SteerlabError: what happens can no longer be kept; the running attempt does not count.
        """
        for drive in drives:
            self._screen.enter(drive.world)
            if not self._until_accepted(drive):
                return SessionEnd.STOPPED
        page = session_done_page(self._total, self._after)
        self._attempts.prompt.ask(lambda: page, {Act.CONFIRM, Act.STOP})
        return SessionEnd.DONE

    def _until_accepted(self, drive: Drive) -> bool:
        """False to stop."""
        number = self.done + 1

        def show(fraction: float) -> None:
            self._attempts.show_labelled(
                drive, fraction, number=number, count=self._total, instruction=self._instruction
            )

        while True:
            finished = self._attempts.until_finished(drive, show, number=number, count=self._total)
            if finished is None:
                return False
            page = drive_done_page(drive.outcome, finished.failed, number, self._total)
            act = self._attempts.prompt.ask(
                lambda page=page: page, {Act.CONFIRM, Act.REDO, Act.STOP}
            )
            if act is not Act.REDO:
                self.done = number
                return act is not Act.STOP
