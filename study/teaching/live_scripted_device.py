"""A scripted teacher at the wheel of a drive that comes into being: knows only what has been.

Offline, as in calibration, scripted teachers see a rollout's future; here nobody does, so one who
anticipates (a negative delay) labels as if without delay (``sim.live_teacher``).
"""

from math import nan

import numpy as np

from steerlab.learning.agents.contract import GateInput
from steerlab.sim.live_teacher import DriveContext, LiveTeacher, Responding
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Rollout
from steerlab.sim.tasks import HELD_STEPS
from steerlab.study.teaching.conditions import TeacherAction
from steerlab.study.teaching.round_drive import RoundDrive
from steerlab.teleop.devices.contract import (
    Button,
    DeviceInfo,
    DeviceSample,
    InputKind,
)


class LiveScriptedDevice:
    """A ``Device`` for one lesson.

    Who labels does so in the style they correct with, who drives in their softened one. Who may
    take over does when the learner's own gate for scripted people finds it dangerous.
    """

    def __init__(self, teacher: Responding, lesson: RoundDrive) -> None:
        self._name, self._lesson = teacher.name, lesson
        self._live = LiveTeacher(
            teacher, "raw" if lesson.hands is TeacherAction.LABEL else "softened"
        )
        self._last = DeviceSample(wheel=None, ok=False)
        self._held = Driver.ROBOT

    @property
    def info(self) -> DeviceInfo:
        """The teacher's name."""
        return DeviceInfo(kind=InputKind.SCRIPTED, name=self._name)

    def connect(self) -> None:
        """Nothing to open."""

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """A new drive."""
        config = self._lesson.stage.task.driving
        self._live.begin(
            DriveContext(
                name=self._lesson.drive.name,
                order=order,
                attempt=attempt,
                steps=config.max_steps,
                control_hz=config.control_hz,
            )
        )
        self._last, self._held = DeviceSample(wheel=None, ok=False), Driver.ROBOT
        if self._lesson.hands is TeacherAction.TAKE_OVER:
            self._lesson.agent.gate.begin(self._lesson.number, np.random.default_rng(0))

    def read(self, step: int | None = None) -> DeviceSample:
        """The wheel for ``step``; without one, what was said last."""
        if step is not None:
            stage = self._lesson.stage
            truth = stage.oracle(stage.driving.state)
            wheel = self._live.react(truth)
            self._last = DeviceSample(wheel=wheel, buttons=self._pressed(step, wheel, truth))
        return self._last

    def disconnect(self) -> None:
        """Nothing to close."""

    def _pressed(self, step: int, wheel: float, truth: float) -> frozenset[Button]:
        lesson = self._lesson
        if lesson.hands is not TeacherAction.TAKE_OVER:
            return frozenset()
        decision, rest = divmod(step, HELD_STEPS)
        if rest == 0:
            robot = lesson.robot(lesson.stage.driving.state)
            moment = GateInput(decision, self._held, robot, wheel, truth, nan)
            self._held = lesson.agent.gate.who_drives(moment)
        return frozenset({Button.TAKE_OVER} if self._held is Driver.TEACHER else ())
