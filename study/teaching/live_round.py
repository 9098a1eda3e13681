"""A round's drive, ready for the real-time loop: whose wheel the car gets, what the screen says."""

from dataclasses import dataclass, replace
from math import isfinite, nan

from steerlab.learning.agents.drive import HeldGate, Robot, RoundDrive
from steerlab.learning.agents.teaching_contract import FinishedDrive
from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.records import Driver
from steerlab.sim.tasks import HELD_STEPS
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.study.teaching.conditions import (
    FIRST_BEFORE,
    FIRST_DURING,
    TeacherAction,
    TeachingMode,
)
from steerlab.teleop.devices.contract import Button, DeviceSample
from steerlab.teleop.drives.live import LiveDrive
from steerlab.teleop.drives.who_drives import (
    Command,
    PersonDrives,
    RobotDrives,
    Takeover,
    WhoDrives,
)

LEAST_GIVEN = 10  # decisions, 1 s: nobody takes a wheel that is gone again within a moment


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveRound:
    """A drive that a device steers or labels.

    Attributes:
        hands: what the person does in it.
        before: what they read before the first such drive.
        during: one line while it goes on.
    """

    round_drive: RoundDrive
    hands: TeacherAction
    before: tuple[str, ...]
    during: str
    drive: LiveDrive
    robot: Robot

    def finished(self, attempt: int) -> FinishedDrive:
        """The attempt that has just ended."""
        return FinishedDrive(
            name=self.drive.name,
            number=self.round_drive.number,
            attempt=attempt,
            outcome=self.drive.outcome,
            seen=self.robot.seen,
        )


def make_live_round(round_drive: RoundDrive, mode: TeachingMode) -> LiveRound:
    """For a condition that is taught in ``mode``; the person drives the first demonstration."""
    first, env = round_drive.number == 0, round_drive.env
    hands = TeacherAction.DRIVE if first else mode.hands
    robot = Robot(env, round_drive.learner, doubts=round_drive.gate.needs_doubt)

    def oracle(state: DrivingState) -> float | None:
        wheel = env.oracle(state)
        return wheel if isfinite(wheel) else None

    who = WithNoise(who_drives(hands, round_drive, robot), round_drive.start.noise, robot)
    return LiveRound(
        round_drive=round_drive,
        hands=hands,
        before=FIRST_BEFORE if first else mode.before,
        during=FIRST_DURING if first else mode.during,
        drive=LiveDrive(
            round_drive.context.name,
            env.driving,
            robot,
            who,
            oracle=oracle,
            start=round_drive.start.pose,
        ),
        robot=robot,
    )


def who_drives(hands: TeacherAction, round_drive: RoundDrive, robot: Robot) -> WhoDrives:
    """What decides whose wheel the car gets."""
    if hands is TeacherAction.DRIVE:
        return PersonDrives(pedals=False)  # a policy has no pedals either
    if hands is TeacherAction.LABEL:
        return RobotDrives()
    if hands is TeacherAction.TAKE_OVER:
        return Takeover()
    return GateDecides(round_drive, robot)


class GateDecides:
    """The learner's gate says who drives, at each decision; the wheel changes hands bumplessly.

    A person who is asked sees that they drive, and keeps the wheel for ``LEAST_GIVEN`` decisions at
    least, which no gate's paper has: alone, gates change their mind several times a second. What a
    gate reads of the person is their wheel.
    """

    def __init__(self, round_drive: RoundDrive, robot: Robot) -> None:
        self._round_drive, self._robot = round_drive, robot
        self._gate = HeldGate(round_drive.gate, least_given=LEAST_GIVEN)
        self._takeover = Takeover()
        self.begin()

    def begin(self) -> None:
        """The robot drives first, until the gate is asked."""
        self._gate.begin(self._round_drive.number, self._round_drive.gate_rng())
        self._takeover.begin()
        self._step = 0

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The wheel of whom the gate names.

        Raises:
            DeviceError: that is the person, and the device says nothing.
        """
        hand = nan if sample.wheel is None else sample.wheel
        held = self._gate.who_drives(self._step, robot_wheel, hand, nan, self._robot.doubt)
        self._step += 1
        asked = frozenset({Button.TAKE_OVER} if held is Driver.TEACHER else ())
        return self._takeover.command(robot_wheel, replace(sample, buttons=asked))


class WithNoise:
    """Adds noise to whatever wheel is executed, one value a decision; also tells the robot to begin.

    Args:
        noise: (decisions,) in wheel units.
    """

    def __init__(self, who: WhoDrives, noise: FloatArray, robot: Robot) -> None:
        self._who, self._noise, self._robot = who, noise.tolist(), robot
        self._step = 0

    def begin(self) -> None:
        """An attempt starts, with the same noise."""
        self._step = 0
        self._robot.begin()
        self._who.begin()

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The driver's wheel and the noise, within what the car can do.

        Raises:
            DeviceError: the person drives and the device says nothing.
        """
        command = self._who.command(robot_wheel, sample)
        wheel = command.wheel + self._noise[self._step // HELD_STEPS]
        self._step += 1
        return replace(command, wheel=min(WHEEL_LIMIT, max(-WHEEL_LIMIT, wheel)))
