"""What is logged of an attempt, a step at a time or all at once: the same data either way."""

from collections.abc import Sequence
from math import cos, sin
from typing import Any

import numpy as np
import rerun as rr

from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.study.recording import layout
from steerlab.study.store.records import Event
from steerlab.teleop.timing import StepTiming


class DriveLog:
    """Logs steps and events of one attempt to a stream.

    Args:
        stream: to log to; its clocks are turned off, so that nothing depends on when this runs.
        control_hz: steps a second.
    """

    def __init__(
        self, stream: rr.RecordingStream, control_hz: float, car: CarConfig | None = None
    ) -> None:
        self._stream = stream
        self._control_hz = control_hz
        self._car = car or CarConfig()
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)

    def step(self, step: LabelledStep, times: StepTiming | None) -> None:
        """One step, as it happens."""
        self._at(step.step, step.t_s)
        wheels = layout.wheels(step)
        self._log(layout.WHEELS, rr.Scalars(wheels))
        translation, quaternion = _pose(step)
        # from_fields: the constructor would also log an empty value for everything not given
        pose = rr.Transform3D.from_fields(translation=translation, quaternion=quaternion)
        self._log(layout.CAR, pose)
        ways = layout.ways(wheels, self._car)
        strips, colors = [points for points, _ in ways], [rgb for _, rgb in ways]
        self._log(layout.WAYS, rr.LineStrips3D(strips, colors=colors))
        if times is not None:
            self._log(layout.TIMING, rr.Scalars(layout.timing_ms(times)))

    def event(self, event: Event) -> None:
        """Something that happened, as it happens."""
        self._at(event.step, event.step / self._control_hz)
        self._log(layout.EVENTS, rr.TextLog(event.what, level=rr.TextLogLevel.INFO))

    def steps(self, steps: Sequence[LabelledStep], times: Sequence[StepTiming | None]) -> None:
        """Several steps at once; ``times`` has an entry for each, None where there is none."""
        if not steps:
            return
        when = [step.step for step in steps], [step.t_s for step in steps]
        wheels = [layout.wheels(step) for step in steps]
        self._send(
            layout.WHEELS,
            *when,
            rr.Scalars.columns(scalars=np.ravel(wheels)).partition([len(row) for row in wheels]),
        )
        poses = [_pose(step) for step in steps]
        translation, quaternion = [xyz_m for xyz_m, _ in poses], [turn for _, turn in poses]
        columns = rr.Transform3D.columns(translation=translation, quaternion=quaternion)
        self._send(layout.CAR, *when, columns)
        ways = [layout.ways(row, self._car) for row in wheels]
        strips: list[FloatArray] = [points for row in ways for points, _ in row]
        colors = [rgb for row in ways for _, rgb in row]
        columns = rr.LineStrips3D.columns(strips=strips, colors=colors)
        self._send(layout.WAYS, *when, columns.partition([len(row) for row in ways]))
        timed = [(s, t) for s, t in zip(steps, times, strict=True) if t is not None]
        if timed:
            ms = [layout.timing_ms(t) for _, t in timed]
            columns = rr.Scalars.columns(scalars=np.ravel(ms)).partition([len(row) for row in ms])
            when = [step.step for step, _ in timed], [step.t_s for step, _ in timed]
            self._send(layout.TIMING, *when, columns)

    def events(self, events: Sequence[Event]) -> None:
        """Several events at once."""
        if events:
            at_step = [event.step for event in events]
            texts = [event.what for event in events]
            columns = rr.TextLog.columns(text=texts, level=[rr.TextLogLevel.INFO] * len(texts))
            at_s = [step / self._control_hz for step in at_step]
            self._send(layout.EVENTS, at_step, at_s, columns)

    def pictures(self, steps: Sequence[LabelledStep], jpegs: Sequence[bytes]) -> None:
        """Camera pictures of these steps, as JPEG files."""
        columns = rr.EncodedImage.columns(
            blob=[np.frombuffer(jpeg, np.uint8) for jpeg in jpegs],
            media_type=["image/jpeg"] * len(jpegs),
        )
        at_step, at_s = [step.step for step in steps], [step.t_s for step in steps]
        self._send(layout.CAMERA, at_step, at_s, columns)

    def _at(self, step: int, t_s: float) -> None:
        self._stream.set_time(layout.STEP, sequence=step)
        self._stream.set_time(layout.TIME, duration=t_s)

    def _log(self, path: str, what: Any) -> None:
        self._stream.log(path, what, strict=True)

    def _send(self, path: str, steps: list[int], t_s: list[float], columns: Any) -> None:
        when = [
            rr.TimeColumn(layout.STEP, sequence=steps),
            rr.TimeColumn(layout.TIME, duration=t_s),
        ]
        self._stream.send_columns(path, when, columns, strict=True)


def _pose(step: LabelledStep) -> tuple[tuple[float, float, float], rr.Quaternion]:
    """Translation in m, and the turn about the vertical."""
    half_rad = step.heading_rad / 2.0
    turn = rr.Quaternion(xyzw=(0.0, 0.0, sin(half_rad), cos(half_rad)))
    return (step.x_m, step.y_m, 0.0), turn
