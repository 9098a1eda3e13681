"""One attempt of a person at a drive: in real time, recorded, and judged by the gates."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from steerlab.sim.errors import SteerlabError
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.teleop.devices.contract import Device
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.loop import DriveEnd, run_drive
from steerlab.teleop.pacing import WallClock, no_garbage_collection
from steerlab.teleop.page_prompt import PagePrompt
from steerlab.teleop.pages import error_page, pause_page
from steerlab.teleop.screen.contract import DriveView, Page, Screen
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import GateConfig, LoopHealth, TimingViolation, failed_gates
from steerlab.teleop.watch import PersonWatch


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
    """Keeps a session."""

    def begin(self, drive: Drive) -> AttemptRecord:
        """Open the participant's next attempt at a drive."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Attempted:
    """How it ended; without ``health`` it was not finished and does not count."""

    end: DriveEnd
    attempt: int
    failed: Sequence[TimingViolation] = ()
    health: LoopHealth | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Attempts:
    """Who sits before which screen, at which device, and who records it."""

    screen: Screen
    device: Device
    recorder: Recorder
    participant: str
    clock: WallClock
    watch: PersonWatch
    gates: GateConfig
    now_ns: Callable[[], int]
    show_agent_wheel: bool = False
    car: CarConfig = field(default_factory=CarConfig)

    def show(
        self, drive: Drive, fraction: float, *, number: int, count: int, instruction: str
    ) -> None:
        """Draw a frame of a drive, ``fraction`` of the way to its next step."""
        moment, sample = drive.between(fraction), self.device.read()
        agent = self.show_agent_wheel
        self.screen.show_drive(
            DriveView(
                pose=moment.pose,
                road_wheel_rad=self.car.road_wheel_rad(moment.wheel) if agent else 0.0,
                elapsed_s=self.clock.elapsed_s,
                number=number,
                count=count,
                needle=sample.wheel if sample.ok else None,
                agent_needle=moment.wheel if agent else None,
                teacher_drives=moment.gate is Driver.TEACHER,
                device=self.device.info.name,
                device_ok=sample.ok,
                instruction=instruction,
            )
        )

    def pause(self, why: DriveEnd, stage: PagePrompt) -> bool:
        """Say why a drive was cut off, until the person goes on; False to stop."""

        def page() -> Page:
            sample = self.device.read()
            return pause_page(why, sample, self.device.info.name, focused=self.screen.focused)

        return stage.ready(page)

    def run(
        self,
        drive: Drive,
        show: Callable[[float], None],
        *,
        event: Callable[[], str] | None = None,
    ) -> Attempted:
        """One attempt at ``drive``, begun by its caller, to its end.

        Args:
            show: draws a display frame.
            event: what is kept beside a finished attempt, such as how a live drive ended.

        Raises:
            SteerlabError: what happens can no longer be kept; the attempt does not count.
        """
        record = self.recorder.begin(drive)
        sink = _Collecting(record)
        self.watch.begin(self.device.read())
        try:
            with no_garbage_collection():
                end = run_drive(
                    drive,
                    self.device,
                    participant=self.participant,
                    order=record.order,
                    attempt=record.attempt,
                    clock=self.clock,
                    sink=sink,
                    watch=self.watch,
                    show=show,
                    now_ns=self.now_ns,
                )
            if end is not DriveEnd.FINISHED:
                record.event(len(sink.timings), end.value)
                record.abandon(end.value)
                return Attempted(end=end, attempt=record.attempt)
            health = LoopHealth.of(sink.timings, self.clock.frame_ns, self.clock.dropped)
            failed = failed_gates(health, self.gates)
            if event is not None:
                record.event(len(sink.timings), event())
            record.finish(failed)
        except SteerlabError as error:
            self.screen.show_page(error_page(str(error)))
            raise
        return Attempted(end=end, attempt=record.attempt, failed=failed, health=health)


class _Collecting:
    """Passes steps on, and keeps their timings for the gates."""

    def __init__(self, record: AttemptRecord) -> None:
        self._record = record
        self.timings: list[StepTiming] = []

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        self._record.step(step, timing)
        if timing is not None:
            self.timings.append(timing)
