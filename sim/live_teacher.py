"""A scripted teacher who drives: its response to what it has seen so far, step by step.

Offline a teacher sees a whole rollout, its future too. At the wheel nobody does: a negative delay
(anticipation) then acts as none.
"""

from dataclasses import dataclass, replace
from math import nan
from typing import Literal, Protocol

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherNotReady
from steerlab.sim.unusual_teachers import UnusualTeacher
from steerlab.sim.world import WorldSpec

DrivingStyle = Literal["softened", "raw"]
SOFT_GAIN_POWER = 0.3
SOFT_SHARE = 0.3  # of delay and dead zone
# People correct a drive they watch more clumsily than they drive: with its raw delay and gain a
# scripted teacher crashes in about half of its own demonstrations, which makes a straw man of
# whatever learns from them. Powers and shares are assumptions; ``raw`` is the ablation.


class Responding(Protocol):
    """A teacher who answers a whole rollout: scripted, or unusual."""

    name: str

    def respond(self, rollout: Rollout, *, order: int, attempt: int) -> FloatArray:
        """Labels for all steps, (steps,)."""
        ...


@dataclass(frozen=True, kw_only=True)
class DriveContext:
    """Which drive of a teacher's session this is; their noise and drift depend on it.

    Attributes:
        order: drives the teacher has seen before, those of the calibration included.
        attempt: at this drive, from 0.
        steps: control steps until the time limit.
        round_number: of the teaching; 0 is the first demonstration.
    """

    name: str
    order: int
    attempt: int
    steps: int
    control_hz: float
    round_number: int = 0


class LiveTeacher:
    """Drives, or watches ready to drive; ``react`` once a control step.

    Args:
        teacher: whose style it is.
        style: ``softened`` for how they drive, ``raw`` for how they correct.
    """

    def __init__(self, teacher: Responding, style: DrivingStyle = "softened") -> None:
        self._teacher = softened(teacher) if style == "softened" else teacher
        self._context: DriveContext | None = None
        self._seen = np.empty(0)
        self._robot = np.empty(0)
        self._step = 0

    def begin(self, context: DriveContext) -> None:
        """A new drive; nothing has been seen."""
        self._context = context
        self._seen = np.full(context.steps, np.nan)
        self._robot = np.full(context.steps, np.nan)
        self._step = 0

    def react(self, oracle: float, robot_wheel: float = nan) -> float:
        """The wheel for this step, within ±``WHEEL_LIMIT``.

        Args:
            oracle: ground truth now; NaN where there is none, which a person bridges.
            robot_wheel: of the robot that they correct, in wheel units; NaN for who drives, and
                therefore steers however well a robot would.

        Raises:
            TeacherNotReady: ``begin`` was not called, or the drive is longer than it said.
        """
        context, step = self._context, self._step
        if context is None or step >= context.steps:
            raise TeacherNotReady(f"{self._teacher.name} is in no drive; call begin first.")
        if np.isnan(oracle):
            oracle = float(self._seen[step - 1]) if step else 0.0  # straight on until a way shows
        self._seen[step:] = oracle  # whatever comes is taken to stay, so every draw keeps its place
        self._robot[step:] = robot_wheel
        self._step = step + 1
        stub = _only_wheels(context, self._seen, self._robot)
        labels = self._teacher.respond(stub, order=context.order, attempt=context.attempt)
        return float(labels[step])


def softened(teacher: Responding) -> Responding:
    """The same person driving: gain^0.3, and 0.3 of delay and dead zone; noise stays.

    Raises:
        InvalidConfig: a kind of teacher whose style is not known.
    """
    if isinstance(teacher, UnusualTeacher):
        return UnusualTeacher(_soft(teacher.scripted), teacher.quirk)
    if isinstance(teacher, ScriptedTeacher):
        return _soft(teacher)
    raise InvalidConfig(f"{teacher.name} is a {type(teacher).__name__}; its style is not known.")


def _soft(teacher: ScriptedTeacher) -> ScriptedTeacher:
    style = teacher.style
    soft = replace(
        style,
        gain=style.gain**SOFT_GAIN_POWER,
        delay_s=SOFT_SHARE * style.delay_s,
        dead_zone=SOFT_SHARE * style.dead_zone,
    )
    return ScriptedTeacher(teacher.name, soft, teacher.seed)


def _only_wheels(context: DriveContext, labels: FloatArray, robot_wheel: FloatArray) -> Rollout:
    """A rollout of which only labels and the robot's wheel count; teachers read nothing else."""
    steps = context.steps
    return Rollout(
        name=context.name,
        world=_NOWHERE,
        control_hz=context.control_hz,
        seed=0,
        outcome=Outcome.RUNNING,
        t_s=np.arange(steps) / context.control_hz,
        pose=np.zeros((steps, 3)),
        velocity=np.zeros((steps, 3)),
        acceleration=np.zeros((steps, 2)),
        robot_wheel=robot_wheel,
        oracle_label=labels,
        oracle_valid=np.isfinite(labels),
        physics_state=np.zeros((steps, 0)),
    )


_NOWHERE = WorldSpec(name="nowhere", ball_xy_m=(10.0, 0.0), start=Pose2D(0.0, 0.0, 0.0))
