"""Pacing: absolute deadlines, so that nothing drifts however long a step takes."""

import gc
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns, sleep

from steerlab.sim.errors import InvalidConfig

NS_PER_S = 1_000_000_000
Show = Callable[[float], None]
"""Draw a display frame at this fraction, 0 to 1, of the way to the next control step."""


@dataclass(frozen=True, kw_only=True)
class PacingConfig:
    """Rates and how time is passed.

    Attributes:
        poll_s: how often input is taken while waiting: events get their time from it.
        spin_s: before a deadline it no longer sleeps: sleep wakes up to 0.1 ms late.
        guard_s: a display frame is left out unless it is expected to end this long before the
            next control step.
    """

    control_hz: float = 20.0
    display_hz: float = 60.0
    poll_s: float = 0.001
    spin_s: float = 0.0005
    guard_s: float = 0.0005

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0.0:
                raise InvalidConfig(f"PacingConfig.{name} is {value}; it must be positive.")
        frames = self.display_hz / self.control_hz
        if frames < 1.0 or abs(frames - round(frames)) > 1e-9:
            raise InvalidConfig(
                f"display_hz {self.display_hz:g} is no multiple of control_hz "
                f"{self.control_hz:g}; give 20, 40 or 60 Hz for a control rate of 20 Hz."
            )

    @property
    def frames_per_step(self) -> int:
        """Display frames in a control step."""
        return round(self.display_hz / self.control_hz)


@dataclass(frozen=True, slots=True)
class Tick:
    """A control step came due at ``deadline_ns``; the loop woke for it at ``actual_ns``."""

    deadline_ns: int
    actual_ns: int


class WallClock:
    """Paces control and display for a person; late frames are left out, control steps never.

    Args:
        config: rates.
        poll: takes what input has come; called about every millisecond and right before a step.
        now_ns, sleep_s: time itself; tests pass their own.

    Attributes:
        frame_ns: how long each display frame took to draw, in order.
        dropped: display frames left out to be on time.
    """

    def __init__(
        self,
        config: PacingConfig,
        poll: Callable[[], None],
        *,
        now_ns: Callable[[], int] = perf_counter_ns,
        sleep_s: Callable[[float], None] = sleep,
    ) -> None:
        self.config = config
        self.frame_ns: list[int] = []
        self.dropped = 0
        self._poll = poll
        self.now_ns = now_ns
        self._sleep_s = sleep_s
        self._period_ns = round(NS_PER_S / config.control_hz)
        self._frame_period_ns = self._period_ns // config.frames_per_step
        self._poll_ns = round(config.poll_s * NS_PER_S)
        self._spin_ns = round(config.spin_s * NS_PER_S)
        self._guard_ns = round(config.guard_s * NS_PER_S)
        self._start_ns = 0
        self._expected_ns = 0

    def start(self) -> None:
        """Step 0 is due one control period from now: time to draw the first frame."""
        self._start_ns = self.now_ns() + self._period_ns
        self.frame_ns.clear()
        self.dropped = 0

    def wait_for(self, step: int, show: Show | None) -> Tick:
        """Draw the frames before ``step`` as far as there is time, and return when it is due."""
        deadline_ns = self._start_ns + step * self._period_ns
        if show is not None:
            frames = self.config.frames_per_step
            for frame in range(frames):
                due_ns = deadline_ns - (frames - frame) * self._frame_period_ns
                self._wait_until(min(due_ns, deadline_ns))
                began_ns = self.now_ns()
                late = began_ns >= due_ns + self._frame_period_ns
                if late or began_ns + self._expected_ns + self._guard_ns > deadline_ns:
                    self.dropped += 1
                    self._expected_ns = self._expected_ns * 9 // 10  # one slow frame is forgiven
                    continue
                show(frame / frames)
                took_ns = self.now_ns() - began_ns
                self.frame_ns.append(took_ns)
                self._expected_ns = max(took_ns, self._expected_ns * 9 // 10)
        actual_ns = self._wait_until(deadline_ns)
        self._poll()
        return Tick(deadline_ns, actual_ns)

    @property
    def elapsed_s(self) -> float:
        """Since step 0 was due; 0 before that."""
        return max(0.0, (self.now_ns() - self._start_ns) / NS_PER_S)

    @property
    def overrun_ns(self) -> int:
        """A step this late has cost a display frame."""
        return self._frame_period_ns

    def _wait_until(self, deadline_ns: int) -> int:
        while True:
            now_ns = self.now_ns()
            left_ns = deadline_ns - now_ns
            if left_ns <= 0:
                return now_ns
            if left_ns > self._spin_ns:
                self._sleep_s(min(left_ns - self._spin_ns, self._poll_ns) / NS_PER_S)
                if deadline_ns - self.now_ns() > self._spin_ns:
                    self._poll()


@contextmanager
def no_garbage_collection() -> Generator[None]:
    """Collect now, and then not until the block ends: a collection costs several frames."""
    gc.collect()
    gc.freeze()
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_on:
            gc.enable()
