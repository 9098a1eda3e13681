"""One drive of a teaching phase: where it starts, whose wheel the car gets, what the screen says."""

from dataclasses import dataclass
from math import isfinite

from steerlab.learning.agents.contract import Agent, Learner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.tasks import draw_task_start, redraw_noise
from steerlab.study.teaching.conditions import (
    FIRST_BEFORE,
    FIRST_DURING,
    TeacherAction,
    TeachingMode,
)
from steerlab.study.teaching.driver import WithNoise, who_drives
from steerlab.study.teaching.robot import Robot
from steerlab.teleop.drives.live import LiveDrive


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundDrive:
    """A drive, ready to go.

    Attributes:
        number: of the round; 0 is the first demonstration.
        hands: what the person does in it.
        before: what they read before the first such drive.
        during: one line while it goes on.
        agent: whose gate a scripted person takes over by.
    """

    number: int
    hands: TeacherAction
    before: tuple[str, ...]
    during: str
    drive: LiveDrive
    robot: Robot
    stage: TaskEnv
    agent: Agent


def make_lesson(
    stage: TaskEnv,
    taught_by: TeachingMode,
    agent: Agent,
    learner: Learner | None,
    *,
    name: str,
    number: int,
    attempt: int,
    seed: int,
) -> RoundDrive:
    """Round ``number``; start and noise depend on ``seed`` and number, never on the condition.

    Args:
        learner: None for the first demonstration.
        attempt: of the first demonstration, whose noise is another at each try.
    """
    start = draw_task_start(stage.task, "teach", seed, number)
    if number == 0:
        start = redraw_noise(stage.task, start, seed, attempt)
    robot = Robot(stage, learner, doubts=agent.gate.needs_doubt)
    hands = TeacherAction.DRIVE if number == 0 else taught_by.hands

    def oracle(state: DrivingState) -> float | None:
        wheel = stage.oracle(state)
        return wheel if isfinite(wheel) else None

    return RoundDrive(
        number=number,
        hands=hands,
        before=FIRST_BEFORE if number == 0 else taught_by.before,
        during=FIRST_DURING if number == 0 else taught_by.during,
        drive=LiveDrive(
            name,
            stage.driving,
            robot,
            WithNoise(who_drives(hands, agent, robot, number, seed), start.noise, robot),
            oracle=oracle,
            start=start.pose,
        ),
        robot=robot,
        stage=stage,
        agent=agent,
    )
