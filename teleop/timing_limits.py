"""Was an attempt's timing good enough to trust its labels? Attempts that were not are flagged."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from steerlab.teleop.timing import StepTiming

NS_PER_MS = 1e6


@dataclass(frozen=True, kw_only=True)
class GateConfig:
    """Limits on an idle study PC; beyond one of them the attempt is flagged and a redo offered."""

    lateness_p99_ms: float = 2.0
    lateness_max_ms: float = 10.0
    dropped_share: float = 0.005  # of display frames
    overrun_share: float = 0.001  # of control steps
    input_age_p99_ms: float = 5.0


@dataclass(frozen=True, kw_only=True)
class LoopHealth:
    """How the loop kept time in one attempt.

    Attributes:
        lateness_p50_ms, lateness_p99_ms, lateness_max_ms: from deadline to waking, control steps.
        overruns: control steps so late that a display frame was lost.
        frames, dropped: display frames drawn, and left out to be on time.
        frame_p50_ms, frame_p99_ms: time to draw one; 0 without a display.
        input_age_p50_ms, input_age_p99_ms: from the device's last event to the step's sample, over
            the steps in which an event came at all: a wheel held still sends none. None if none.
    """

    steps: int
    lateness_p50_ms: float
    lateness_p99_ms: float
    lateness_max_ms: float
    overruns: int
    frames: int
    dropped: int
    frame_p50_ms: float
    frame_p99_ms: float
    input_age_p50_ms: float | None
    input_age_p99_ms: float | None

    @classmethod
    def of(
        cls, timings: Sequence[StepTiming], frame_ns: Sequence[int], dropped: int
    ) -> "LoopHealth":
        """Of at least one step."""
        late_ms = np.array([timing.lateness_ns for timing in timings]) / NS_PER_MS
        p50, p99 = np.percentile(late_ms, (50, 99))
        frame_p50, frame_p99 = _percentiles_ms(frame_ns) or (0.0, 0.0)
        fresh = [
            now.event_age_ns
            for before, now in pairwise(timings)
            if now.event_age_ns is not None and now.event_age_ns < now.sample_ns - before.sample_ns
        ]
        age_p50, age_p99 = _percentiles_ms(fresh) or (None, None)
        return cls(
            steps=len(timings),
            lateness_p50_ms=float(p50),
            lateness_p99_ms=float(p99),
            lateness_max_ms=float(late_ms.max()),
            overruns=sum(timing.overrun for timing in timings),
            frames=len(frame_ns),
            dropped=dropped,
            frame_p50_ms=frame_p50,
            frame_p99_ms=frame_p99,
            input_age_p50_ms=age_p50,
            input_age_p99_ms=age_p99,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class TimingViolation:
    """A limit that an attempt broke."""

    name: str
    value: float
    limit: float

    def __str__(self) -> str:
        return f"{self.name.replace('_', ' ')} {self.value:.3g} (limit {self.limit:g})"


def failed_gates(health: LoopHealth, config: GateConfig) -> list[TimingViolation]:
    """The limits that this attempt broke; none is well."""
    shown = health.frames + health.dropped
    measured = {
        "lateness_p99_ms": health.lateness_p99_ms,
        "lateness_max_ms": health.lateness_max_ms,
        "dropped_share": health.dropped / shown if shown else 0.0,
        "overrun_share": health.overruns / health.steps,
        "input_age_p99_ms": health.input_age_p99_ms,
    }
    return [
        TimingViolation(name=name, value=value, limit=getattr(config, name))
        for name, value in measured.items()
        if value is not None and value > getattr(config, name)
    ]


def _percentiles_ms(times_ns: Sequence[int]) -> tuple[float, float] | None:
    if not times_ns:
        return None
    p50, p99 = np.percentile(np.asarray(times_ns) / NS_PER_MS, (50, 99))
    return float(p50), float(p99)
