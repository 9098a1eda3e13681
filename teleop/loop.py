"""The loop in which a teacher labels a drive: the same for a wheel and for a script.

Everything is indexed by control step. Only the clock knows of wall time: a person's clock waits
for each step's deadline and shows the drive meanwhile, a script's does not wait at all.
"""

from collections.abc import Callable
from enum import StrEnum
from time import perf_counter_ns
from typing import Protocol

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import LabelledStep
from steerlab.sim.rollout import Rollout
from steerlab.sim.teachers import Teacher
from steerlab.teleop.devices.contract import Device, DeviceSample
from steerlab.teleop.devices.scripted import ScriptedDevice
from steerlab.teleop.drives.contract import Drive
from steerlab.teleop.drives.replay import Replay
from steerlab.teleop.pacing import Show, Tick
from steerlab.teleop.timing import StepTiming


class DriveEnd(StrEnum):
    """Why the loop ended; after anything but ``FINISHED`` the attempt is redone from step 0."""

    FINISHED = "finished"
    PAUSED = "paused"
    REDO = "redo"
    STOPPED = "stopped"
    FOCUS_LOST = "the window lost the focus"
    DEVICE_LOST = "the device was lost"


class Clock(Protocol):
    """Says when a control step is due."""

    def start(self) -> None:
        """An attempt begins."""
        ...

    def wait_for(self, step: int, show: Show | None) -> Tick | None:
        """Return when ``step`` is due, showing the drive meanwhile; None if time means nothing."""
        ...

    @property
    def overrun_ns(self) -> int:
        """A step that comes this late is an overrun."""
        ...


class NullClock:
    """Every step is due at once: simulated teachers need no time."""

    overrun_ns = 0

    def start(self) -> None:
        """Nothing to start."""

    def wait_for(self, step: int, show: Show | None) -> None:
        """Return at once."""


class StepSink(Protocol):
    """Keeps what happens."""

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Keep one step; returns at once.

        Raises:
            SteerlabError: steps can no longer be kept; the drive must stop.
        """
        ...


class LabelSink:
    """Keeps nothing but the labels."""

    def __init__(self) -> None:
        self._labels: list[float | None] = []

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Keep the step's label."""
        self._labels.append(step.teacher_label)

    def labels(self) -> FloatArray:
        """(steps,) labels in [-2.5, 2.5]; NaN where the teacher gave none."""
        return np.array(self._labels, dtype=np.float64)


class Watch(Protocol):
    """Looks after a drive that a person takes part in."""

    @property
    def focused(self) -> bool:
        """The window has the keyboard's focus."""
        ...

    def interruption(self, sample: DeviceSample) -> DriveEnd | None:
        """Why the drive must not go on with this sample; None while it may."""
        ...


def run_drive(
    drive: Drive,
    device: Device,
    *,
    participant: str,
    order: int,
    attempt: int = 0,
    clock: Clock,
    sink: StepSink,
    watch: Watch | None = None,
    show: Show | None = None,
    now_ns: Callable[[], int] = perf_counter_ns,
) -> DriveEnd:
    """Let whoever holds ``device`` watch or drive ``drive`` once, from its first step.

    Args:
        order: the drive's place in the participant's session, from 0.
        watch: for people; without it a missing label is only recorded as missing.
        show: draws a display frame.

    Raises:
        SteerlabError: ``sink`` can keep no more steps.
    """
    drive.begin(participant=participant, attempt=attempt)
    device.begin(drive.rollout, order=order, attempt=attempt)
    clock.start()
    step = 0
    while not drive.over:
        tick = clock.wait_for(step, show)
        sample = device.read(step)
        timing = None
        if tick is not None:
            sample_ns = now_ns()
            event_ns = sample.t_event_ns
            timing = StepTiming(
                deadline_ns=tick.deadline_ns,
                actual_ns=tick.actual_ns,
                sample_ns=sample_ns,
                event_age_ns=None if event_ns is None else sample_ns - event_ns,
                overrun=tick.actual_ns - tick.deadline_ns >= clock.overrun_ns,
                focus=watch is None or watch.focused,
                device_ok=sample.ok,
            )
        end = None if watch is None else watch.interruption(sample)
        if end is not None:
            return end
        sink.step(drive.step(step, sample), timing)
        step += 1
    return DriveEnd.FINISHED


def label_rollout(
    rollout: Rollout, teacher: Teacher, *, order: int, attempt: int = 0
) -> FloatArray:
    """Let a scripted teacher label a rollout, through the loop that people go through.

    Args:
        order: the rollout's place in the teacher's session, from 0.

    Returns:
        (steps,) labels in [-2.5, 2.5]; NaN where the teacher gave none.
    """
    sink = LabelSink()
    run_drive(
        Replay(rollout),
        ScriptedDevice(teacher),
        participant=teacher.name,
        order=order,
        attempt=attempt,
        clock=NullClock(),
        sink=sink,
    )
    return sink.labels()
