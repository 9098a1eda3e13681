"""A person's session: drive after drive, with countdown, pauses and redos, until all are done."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from time import perf_counter_ns, sleep

from steerlab.sim.errors import InvalidConfig
from steerlab.teleop.attempt import Attempts, Recorder
from steerlab.teleop.devices.contract import Device
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.loop import DriveEnd
from steerlab.teleop.pacing import PacingConfig, WallClock
from steerlab.teleop.page_prompt import PagePrompt
from steerlab.teleop.pages import (
    drive_done_page,
    session_done_page,
)
from steerlab.teleop.screen.contract import Act, Screen
from steerlab.teleop.timing_limits import GateConfig, LoopHealth
from steerlab.teleop.watch import PersonWatch


@dataclass(frozen=True, kw_only=True)
class SessionConfig:
    """How a session goes.

    Attributes:
        show_agent_wheel: may anchor the labels, which are what is studied: off by default.
    """

    countdown_s: float = 3.0
    instruction: str = "Steer as you think the car should have steered."
    show_agent_wheel: bool = False
    pacing: PacingConfig = field(default_factory=PacingConfig)
    gates: GateConfig = field(default_factory=GateConfig)

    def __post_init__(self) -> None:
        if not self.countdown_s >= 0.0:
            raise InvalidConfig(f"countdown_s is {self.countdown_s}; it must not be negative.")


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
        health: of each attempt finished in this session.
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
        self._participant = participant
        self._config = config or SessionConfig()
        self._total = total
        self.done = done
        self._clock = WallClock(self._config.pacing, poll, now_ns=now_ns, sleep_s=sleep_s)
        self._watch = PersonWatch(screen)
        self._stage = PagePrompt(screen, device, poll, self._watch, now_ns=now_ns, sleep_s=sleep_s)
        self._attempts = Attempts(
            screen=screen,
            device=device,
            recorder=recorder,
            participant=participant,
            clock=self._clock,
            watch=self._watch,
            gates=self._config.gates,
            now_ns=now_ns,
            show_agent_wheel=self._config.show_agent_wheel,
        )
        self.health: list[LoopHealth] = []

    def run(self, drives: Iterable[Drive]) -> SessionEnd:
        """Show each drive until it has a finished attempt.

        Raises:
            SteerlabError: what happens can no longer be kept; the running attempt does not count.
        """
        for drive in drives:
            self._screen.enter(drive.world)
            if not self._until_finished(drive):
                return SessionEnd.STOPPED
        self._stage.ask(lambda: session_done_page(self._total), {Act.CONFIRM, Act.STOP})
        return SessionEnd.DONE

    def _until_finished(self, drive: Drive) -> bool:
        while True:
            if not self._countdown(drive):
                return False
            tried = self._attempts.run(drive, lambda fraction: self._show(drive, fraction))
            end = tried.end
            if tried.health is not None:
                self.health.append(tried.health)
            if end is DriveEnd.STOPPED:
                return False
            if end is not DriveEnd.FINISHED:
                if end is not DriveEnd.REDO and not self._attempts.pause(end, self._stage):
                    return False
                continue
            page = drive_done_page(drive.outcome, tried.failed, self.done + 1, self._total)
            act = self._stage.ask(lambda page=page: page, {Act.CONFIRM, Act.REDO, Act.STOP})
            if act is not Act.REDO:
                self.done += 1
                return act is not Act.STOP

    def _show(self, drive: Drive, fraction: float) -> None:
        self._attempts.show(
            drive,
            fraction,
            number=self.done + 1,
            count=self._total,
            instruction=self._config.instruction,
        )

    def _countdown(self, drive: Drive) -> bool:
        """Over the still start; False to stop."""
        drive.begin(participant=self._participant, attempt=0)
        self._clock.start()
        self._show(drive, 0.0)
        return self._stage.countdown(self.done + 1, self._total, self._config.countdown_s)
