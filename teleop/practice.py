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
from steerlab.teleop.markers import Markers, marked
from steerlab.teleop.pacing import PacingConfig
from steerlab.teleop.pages import BALL, pedals_page, practice_done_page, practice_page
from steerlab.teleop.screen.contract import Act, DriveView, Page, Screen
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import TimingViolation

_PRACTICE = "practice"


@dataclass(frozen=True, kw_only=True)
class PracticeConfig:
    """How long and where to practise.

    Attributes:
        balls: how many to reach before it is over.
        driven_s: it is over after so much driving too, whichever comes first; the drive under way
            is finished, and no other begins. None: only the balls count.
        pedals: drive with throttle and brake; without, at cruise speed.
        seed: of the worlds, each with few blocks.
        after: what comes next on the person's page; empty if nothing does.
    """

    balls: int = 5
    driven_s: float | None = None
    pedals: bool = True
    seed: int = 0
    time_limit_s: float = 120.0  # for one ball
    countdown_s: float = 3.0
    after: str = ""

    def __post_init__(self) -> None:
        if self.balls < 1:
            raise InvalidConfig(f"balls is {self.balls}; it must be at least 1.")
        if self.driven_s is not None and not self.driven_s > 0.0:
            raise InvalidConfig(f"driven_s is {self.driven_s}; it must be above 0.")

    def enough(self, balls: int, driven_s: float) -> bool:
        """Practice is over once so many balls were reached in so much driving."""
        return balls >= self.balls or (self.driven_s is not None and driven_s >= self.driven_s)


@dataclass(frozen=True, kw_only=True, slots=True)
class PracticeResult:
    """What came of it: counts, and never how anybody steered.

    Attributes:
        driven_s: time at the wheel while the car drove, in drives that were cut off as well.
    """

    balls: int
    crashes: int
    driven_s: float
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
        markers: Markers | None = None,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self._screen = screen
        self._device = device
        self._config = config or PracticeConfig()
        self._unrecorded = Unrecorded()
        self._attempts = AttemptLoop(
            screen=screen,
            device=device,
            poll=poll,
            recorder=marked(
                self._unrecorded, markers, participant=_PRACTICE, device=device.info.name
            ),
            participant=_PRACTICE,
            config=SessionConfig(
                countdown_s=self._config.countdown_s, pacing=pacing or PacingConfig()
            ),
            now_ns=now_ns,
            sleep_s=sleep_s,
        )
        self._prompt = self._attempts.prompt
        self._balls = self._crashes = 0
        self._driven_s = 0.0

    def run(self) -> PracticeResult:
        """Practise."""
        number = 0
        while not self._enough:
            world = practice_world(self._config, number)
            with _drive_in(world, self._config) as drive:
                self._screen.enter(world)
                if not self._until_reached(drive):
                    return self._result(stopped=True)
            number += 1
        self._prompt.ask(
            lambda: practice_done_page(self._balls, self._crashes, self._config.after),
            {Act.CONFIRM, Act.STOP},
        )
        return self._result(stopped=False)

    @property
    def _enough(self) -> bool:
        return self._config.enough(self._balls, self._driven_s)

    def _result(self, *, stopped: bool) -> PracticeResult:
        return PracticeResult(
            balls=self._balls, crashes=self._crashes, driven_s=self._driven_s, stopped=stopped
        )

    def _until_reached(self, drive: LiveDrive) -> bool:
        """Drive until this ball is reached or practice is over; False to stop."""
        while True:
            finished = self._attempts.until_finished(
                drive,
                lambda fraction: self._show(drive, fraction),
                number=self._balls + 1,
                count=self._config.balls,
                what=BALL,
                before=self._pedals_work if self._config.pedals else None,
            )
            self._driven_s = self._unrecorded.steps / drive.control_hz
            if finished is None:
                return False
            reached = drive.outcome is Outcome.BALL_REACHED
            self._balls += reached
            self._crashes += drive.outcome is Outcome.BLOCK_HIT
            if self._enough:
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
        frame, sample = drive.between(fraction), self._device.read()
        self._screen.show_drive(
            DriveView(
                pose=frame.pose,
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
                speed_mps=frame.speed_mps,
                outcome=drive.outcome,
            )
        )


def _has_pedals(sample: DeviceSample) -> bool:
    return sample.throttle is not None and sample.brake is not None


class Unrecorded:
    """Practice is not recorded: a recorder, and the record of each attempt, that only count.

    Attributes:
        steps: how many there were.
    """

    attempt = order = 0

    def __init__(self) -> None:
        self.steps = 0

    def begin(self, drive: Drive) -> "Unrecorded":
        """The next attempt."""
        return self

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Forget it, but that it was."""
        self.steps += 1

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
