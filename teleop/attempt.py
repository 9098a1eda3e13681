"""A person's attempts at a drive: countdown, real time, pauses and redos, until one is finished."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter_ns, sleep
from typing import Protocol

from steerlab.sim.errors import InvalidConfig, SteerlabError
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.teleop.devices.contract import Device
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.loop import DriveEnd, run_drive
from steerlab.teleop.pacing import NS_PER_S, PacingConfig, WallClock, no_garbage_collection
from steerlab.teleop.page_prompt import PAGE_S, PagePrompt
from steerlab.teleop.pages import ROLLOUT, error_page, pause_page
from steerlab.teleop.screen.contract import DriveView, Page, Screen
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import GateConfig, LoopHealth, TimingViolation, failed_gates
from steerlab.teleop.watch import PersonWatch


@dataclass(frozen=True, kw_only=True)
class SessionConfig:
    """How drives are shown to a person.

    Attributes:
        ending_s: how long the end of a drive stays on the screen, with what it was.
        show_agent_wheel: may anchor the labels, which are what is studied: off by default.
        after: what comes next on the person's page; empty if nothing does.
    """

    countdown_s: float = 3.0
    ending_s: float = 0.8
    instruction: str = "Steer as you think the car should have steered."
    show_agent_wheel: bool = False
    pacing: PacingConfig = field(default_factory=PacingConfig)
    gates: GateConfig = field(default_factory=GateConfig)
    after: str = ""

    def __post_init__(self) -> None:
        for name in ("countdown_s", "ending_s"):
            if not getattr(self, name) >= 0.0:
                raise InvalidConfig(f"{name} is {getattr(self, name)}; it must not be negative.")


class AttemptRecord(Protocol):
    """Keeps one attempt; ``order`` is its place in the participant's session."""

    attempt: int
    order: int

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Keep one step; returns at once.

        Raises:
            SteerlabError: steps can no longer be kept.
        """
        ...

    def event(self, step: int, what: str) -> None:
        """Keep that something happened."""
        ...

    def finish(self, failed: Sequence[TimingViolation]) -> None:
        """All steps are there; durable when this returns."""
        ...

    def abandon(self, reason: str) -> None:
        """The attempt does not count; its steps stay."""
        ...


class Recorder(Protocol):
    """Keeps a session, or nothing of it."""

    def begin(self, drive: Drive) -> AttemptRecord:
        """Open the participant's next attempt at a drive."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class FinishedAttempt:
    """An attempt that reached the end of its drive, and the timing limits that it broke."""

    attempt: int
    failed: Sequence[TimingViolation]


class AttemptLoop:
    """The one loop in which a person labels, practises and teaches.

    Args:
        poll: empties the event queue.
        now_ns, sleep_s: time itself; tests pass their own.

    Attributes:
        clock: of the running attempt.
        prompt: asks the person something between attempts.
        watch: what the person presses.
        health: the loop's, one of each finished attempt.
    """

    def __init__(
        self,
        *,
        screen: Screen,
        device: Device,
        poll: Callable[[], None],
        recorder: Recorder,
        participant: str,
        config: SessionConfig,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self._screen, self._device, self._recorder = screen, device, recorder
        self._participant, self._config, self._now_ns = participant, config, now_ns
        self._poll, self._sleep_s = poll, sleep_s
        self._car = CarConfig()
        self.clock = WallClock(config.pacing, poll, now_ns=now_ns, sleep_s=sleep_s)
        self.watch = PersonWatch(screen)
        self.prompt = PagePrompt(screen, device, poll, self.watch, now_ns=now_ns, sleep_s=sleep_s)
        self.health: list[LoopHealth] = []

    def until_finished(
        self,
        drive: Drive,
        show: Callable[[float], None],
        *,
        number: int,
        count: int,
        what: str = ROLLOUT,
        before: Callable[[], bool] | None = None,
        event: Callable[[], str] | None = None,
    ) -> FinishedAttempt | None:
        """Attempts at ``drive`` until one is finished; None if the person stops.

        Args:
            show: draws a display frame, a fraction of the way to the next step.
            number, count: of the drive, from 1, for the countdown.
            what: the word for a drive there.
            before: what the person must do over the still start; False to stop.
            event: what is kept beside a finished attempt, such as how a live drive ended.

        Raises:
            SteerlabError: what happens can no longer be kept; the running attempt does not count.
        """
        while True:
            drive.begin(participant=self._participant, attempt=0)
            self.clock.start()
            show(0.0)
            if before is not None and not before():
                return None
            if not self.prompt.countdown(number, count, self._config.countdown_s, what=what):
                return None
            end = self._attempt(drive, show, event)
            if isinstance(end, FinishedAttempt):
                self._show_end(show)
                return end
            if end is DriveEnd.STOPPED:
                return None
            if end is not DriveEnd.REDO and not self._pause(end):
                return None

    def show_labelled(
        self, drive: Drive, fraction: float, *, number: int, count: int, instruction: str
    ) -> None:
        """Draw a frame of a drive that is recorded, ``fraction`` of the way to its next step."""
        frame, sample = drive.between(fraction), self._device.read()
        agent = self._config.show_agent_wheel
        self._screen.show_drive(
            DriveView(
                pose=frame.pose,
                road_wheel_rad=self._car.road_wheel_rad(frame.wheel) if agent else 0.0,
                elapsed_s=self.clock.elapsed_s,
                number=number,
                count=count,
                needle=sample.wheel if sample.ok else None,
                agent_needle=frame.wheel if agent else None,
                teacher_drives=frame.gate is Driver.TEACHER,
                device=self._device.info.name,
                device_ok=sample.ok,
                instruction=instruction,
                speed_mps=frame.speed_mps,
                outcome=drive.outcome,
            )
        )

    def _show_end(self, show: Callable[[float], None]) -> None:
        """Let the person see how a drive ended, before a page covers it; nothing is kept of it."""
        until_ns = self._now_ns() + round(self._config.ending_s * NS_PER_S)
        while self._now_ns() < until_ns:
            self._poll()
            show(1.0)
            self._sleep_s(PAGE_S)

    def _attempt(
        self, drive: Drive, show: Callable[[float], None], event: Callable[[], str] | None
    ) -> FinishedAttempt | DriveEnd:
        record = self._recorder.begin(drive)
        sink = _Collecting(record)
        self.watch.begin(self._device.read())
        try:
            with no_garbage_collection():
                end = run_drive(
                    drive,
                    self._device,
                    participant=self._participant,
                    order=record.order,
                    attempt=record.attempt,
                    clock=self.clock,
                    sink=sink,
                    watch=self.watch,
                    show=show,
                    now_ns=self._now_ns,
                )
            if end is not DriveEnd.FINISHED:
                record.event(len(sink.timings), end.value)
                record.abandon(end.value)
                return end
            health = LoopHealth.of(sink.timings, self.clock.frame_ns, self.clock.dropped)
            failed = failed_gates(health, self._config.gates)
            if event is not None:
                record.event(len(sink.timings), event())
            record.finish(failed)
        except SteerlabError as error:
            self._screen.show_page(error_page(str(error)))
            raise
        self.health.append(health)
        return FinishedAttempt(attempt=record.attempt, failed=failed)

    def _pause(self, why: DriveEnd) -> bool:
        """Say why a drive was cut off, until the person goes on; False to stop."""

        def page() -> Page:
            sample = self._device.read()
            return pause_page(why, sample, self._device.info.name, focused=self._screen.focused)

        return self.prompt.ready(page)


class _Collecting:
    """Passes steps on, and keeps their timings for the limits."""

    def __init__(self, record: AttemptRecord) -> None:
        self._record = record
        self.timings: list[StepTiming] = []

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        self._record.step(step, timing)
        if timing is not None:
            self.timings.append(timing)
