"""Marks in time beside a drive, for recorders of other signals such as Lab Streaming Layer's.

``MarkedRecorder`` tells them of each attempt, whoever keeps it; docs/markers.md says what they mean.
"""

from collections.abc import Sequence
from time import perf_counter_ns
from typing import Protocol

from steerlab.sim.records import Driver, LabelledStep
from steerlab.teleop.attempt import AttemptRecord, Recorder
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import TimingViolation


class Markers(Protocol):
    """Takes marks; its methods return at once and never raise.

    Times are those of ``perf_counter_ns``, whose clock the loop's own times are on.
    """

    def mark(self, what: str, at_ns: int, /, **details: str | int | float) -> None:
        """Something happened."""
        ...

    def step(self, order: int, step: int, at_ns: int) -> None:
        """The wheel was sampled for this control step of the participant's ``order``-th attempt."""
        ...


def marked(
    recorder: Recorder, markers: Markers | None, *, participant: str, device: str
) -> Recorder:
    """``recorder``, whose attempts are told to ``markers`` if there are any."""
    if markers is None:
        return recorder
    return MarkedRecorder(recorder, markers, participant=participant, device=device)


class MarkedRecorder:
    """A recorder that also marks what it is given.

    Args:
        device: its name.
    """

    def __init__(
        self, recorder: Recorder, markers: Markers, *, participant: str, device: str
    ) -> None:
        self._recorder, self._markers = recorder, markers
        self._participant, self._device = participant, device

    def begin(self, drive: Drive) -> "_MarkedRecord":
        """Open the participant's next attempt at a drive."""
        record = self._recorder.begin(drive)
        self._markers.mark(
            "drive_begin",
            perf_counter_ns(),
            participant=self._participant,
            rollout=drive.name,
            attempt=record.attempt,
            order=record.order,
            control_hz=drive.control_hz,
            device=self._device,
        )
        return _MarkedRecord(record, drive, self._markers)


class _MarkedRecord:
    """The record of one attempt, and its marks."""

    def __init__(self, record: AttemptRecord, drive: Drive, markers: Markers) -> None:
        self.attempt, self.order = record.attempt, record.order
        self._record, self._drive, self._markers = record, drive, markers
        self._driver: Driver | None = None

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        self._record.step(step, timing)
        at_ns = perf_counter_ns() if timing is None else timing.sample_ns
        self._markers.step(self.order, step.step, at_ns)
        if step.gate is not self._driver:
            self._driver = step.gate
            self._markers.mark("driver", at_ns, driver=step.gate.value, step=step.step)

    def event(self, step: int, what: str) -> None:
        self._markers.mark("event", perf_counter_ns(), what=what, step=step)
        self._record.event(step, what)

    def finish(self, failed: Sequence[TimingViolation] = ()) -> None:
        at_ns = perf_counter_ns()  # keeping it takes milliseconds
        self._record.finish(failed)
        self._markers.mark("drive_end", at_ns, how="finished", outcome=self._drive.outcome.value)

    def abandon(self, reason: str) -> None:
        at_ns = perf_counter_ns()
        self._record.abandon(reason)
        self._markers.mark("drive_end", at_ns, how="abandoned", reason=reason)
