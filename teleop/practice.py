"""The practice drive: the participant drives to one ball after another, and nothing is labelled."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns, sleep

import numpy as np

from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import LabelledStep
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import WorldSpec
from steerlab.sim.world_generator import WorldConfig, generate_world
from steerlab.teleop.attempt import AttemptLoop, SessionConfig
from steerlab.teleop.devices.contract import Device, DeviceSample
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.drives.live import LiveDrive
from steerlab.teleop.drives.who_drives import PersonDrives
from steerlab.teleop.pacing import PacingConfig
from steerlab.teleop.pages import pedals_page, practice_done_page, practice_page
from steerlab.teleop.screen.contract import Act, DriveView, Page, Screen
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import TimingViolation


@dataclass(frozen=True, kw_only=True)
class PracticeConfig:
    """How long and where to practise.

    Attributes:
        balls: how many to reach before it is over.
        pedals: drive with throttle and brake; without, at cruise speed.
        seed: of the worlds, each with few blocks.
    """

    balls: int = 5
    pedals: bool = True
    seed: int = 0
    time_limit_s: float = 120.0  # for one ball
    countdown_s: float = 3.0

    def __post_init__(self) -> None:
        if self.balls < 1:
            raise InvalidConfig(f"balls is {self.balls}; it must be at least 1.")


@dataclass(frozen=True, slots=True)
class PracticeResult:
    """What came of it."""

    balls: int
    crashes: int
    stopped: bool


def practice_world(config: PracticeConfig, number: int) -> WorldSpec:
    """Where the ``number``-th ball lies, from 0."""
    rng = np.random.default_rng((config.seed, number))
    return generate_world(f"practice-{number}", rng, WorldConfig(blocks=(4, 9)))


class Practice:
    """Drives after drives until enough balls were reached, or the person stops.

    Args:
        poll: empties the event queue.
    """

    def __init__(
        self,
        *,
        screen: Screen,
        device: Device,
        poll: Callable[[], None],
        config: PracticeConfig | None = None,
        pacing: PacingConfig | None = None,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self._screen = screen
        self._device = device
        self._config = config or PracticeConfig()
        self._attempts = AttemptLoop(
            screen=screen,
            device=device,
            poll=poll,
            recorder=Unrecorded(),
            participant="practice",
            config=SessionConfig(
                countdown_s=self._config.countdown_s, pacing=pacing or PacingConfig()
            ),
            now_ns=now_ns,
            sleep_s=sleep_s,
        )
        self._prompt = self._attempts.prompt
        self._balls = self._crashes = 0

    def run(self) -> PracticeResult:
        """Practise."""
        number = 0
        while self._balls < self._config.balls:
            world = practice_world(self._config, number)
            with _drive_in(world, self._config) as drive:
                self._screen.enter(world)
                if not self._until_reached(drive):
                    return PracticeResult(self._balls, self._crashes, stopped=True)
            number += 1
        self._prompt.ask(
            lambda: practice_done_page(self._balls, self._crashes), {Act.CONFIRM, Act.STOP}
        )
        return PracticeResult(self._balls, self._crashes, stopped=False)

    def _until_reached(self, drive: LiveDrive) -> bool:
        """Drive until this ball is reached; False to stop."""
        while True:
            finished = self._attempts.until_finished(
                drive,
                lambda fraction: self._show(drive, fraction),
                number=self._balls + 1,
                count=self._config.balls,
                what="Ball",
                before=self._pedals_work if self._config.pedals else None,
            )
            if finished is None:
                return False
            reached = drive.outcome is Outcome.BALL_REACHED
            self._balls += reached
            self._crashes += drive.outcome is Outcome.BLOCK_HIT
            if reached and self._balls >= self._config.balls:
                return True
            page = practice_page(drive.outcome, self._balls, self._config.balls)
            if self._prompt.ask(lambda page=page: page, {Act.CONFIRM, Act.STOP}) is Act.STOP:
                return False
            if reached:
                return True

    def _pedals_work(self) -> bool:
        """Ask for both pedals until the device knows them; False to stop."""
        return self._prompt.until(self._ask_for_pedals, _has_pedals)

    def _ask_for_pedals(self, sample: DeviceSample) -> Page:
        return pedals_page(sample, self._device.info.name)

    def _show(self, drive: LiveDrive, fraction: float) -> None:
        sample = self._device.read()
        self._screen.show_drive(
            DriveView(
                pose=drive.between(fraction).pose,
                elapsed_s=self._attempts.clock.elapsed_s,
                number=self._balls + 1,
                count=self._config.balls,
                needle=sample.wheel if sample.ok else None,
                device=self._device.info.name,
                device_ok=sample.ok,
                recording=False,
                instruction="Drive to the orange ball.",
                balls=self._balls,
                teacher_drives=True,
            )
        )


def _has_pedals(sample: DeviceSample) -> bool:
    return sample.throttle is not None and sample.brake is not None


class Unrecorded:
    """Practice is not recorded: a recorder, and the record of each attempt, that keep nothing."""

    attempt = order = 0

    def begin(self, drive: Drive) -> "Unrecorded":
        """The next attempt."""
        return self

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Forget it."""

    def event(self, step: int, what: str) -> None:
        """Forget it."""

    def finish(self, failed: Sequence[TimingViolation]) -> None:
        """Nothing to keep."""

    def abandon(self, reason: str) -> None:
        """Nothing to keep."""


@contextmanager
def _drive_in(world: WorldSpec, config: PracticeConfig) -> Iterator[LiveDrive]:
    with Driving(world, config=DrivingConfig(time_limit_s=config.time_limit_s)) as driving:
        yield LiveDrive(world.name, driving, lambda state: 0.0, PersonDrives(pedals=config.pedals))
