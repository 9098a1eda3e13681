"""Whose wheel the car gets while it is taught, and the noise that is added to it."""

from dataclasses import replace

import numpy as np

from steerlab.learning.agents.contract import Agent, Gate, GateInput
from steerlab.sim.records import Driver
from steerlab.sim.rollout import FloatArray
from steerlab.sim.tasks import HELD_STEPS
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.study.teaching.conditions import TeacherAction
from steerlab.study.teaching.robot import Robot
from steerlab.teleop.devices.contract import Button, DeviceSample
from steerlab.teleop.drives.who_drives import (
    Command,
    PersonDrives,
    RobotDrives,
    Takeover,
    WhoDrives,
)

NAN = float("nan")
LEAST_GIVEN = 10  # decisions, 1 s: nobody takes a wheel that is gone again within a moment


def who_drives(
    hands: TeacherAction, agent: Agent, robot: Robot, number: int, seed: int
) -> WhoDrives:
    """What decides in round ``number``; 0 is the first demonstration, which the person drives."""
    if number == 0 or hands is TeacherAction.DRIVE:
        return PersonDrives(pedals=False)  # a policy has no pedals either
    if hands is TeacherAction.LABEL:
        return RobotDrives()
    if hands is TeacherAction.TAKE_OVER:
        return Takeover()
    return GateDecides(agent.gate, robot, number, seed)


class GateDecides:
    """The learner's gate says who drives, at each decision; the wheel changes hands bumplessly.

    A person who is asked sees that they drive, and keeps the wheel for ``LEAST_GIVEN`` decisions at
    least, which no gate's paper has: alone, gates change their mind several times a second. What a
    gate reads of the person is their wheel.
    """

    def __init__(self, gate: Gate, robot: Robot, number: int, seed: int) -> None:
        self._gate, self._robot = gate, robot
        self._number, self._seed = number, seed
        self._takeover = Takeover()
        self.begin()

    def begin(self) -> None:
        """The robot drives first, until the gate is asked."""
        self._gate.begin(self._number, np.random.default_rng([self._seed, self._number, 0x6A7E]))
        self._takeover.begin()
        self._step, self._since, self._held = 0, 0, Driver.ROBOT

    def command(self, robot_wheel: float, sample: DeviceSample) -> Command:
        """The wheel of whom the gate names.

        Raises:
            DeviceError: that is the person, and the device says nothing.
        """
        decision, rest = divmod(self._step, HELD_STEPS)
        self._step += 1
        if rest == 0:
            hand = NAN if sample.wheel is None else sample.wheel
            moment = GateInput(decision, self._held, robot_wheel, hand, NAN, self._robot.doubt)
            named = self._gate.who_drives(moment)
            self._since += 1
            keeps = self._held is Driver.TEACHER and self._since < LEAST_GIVEN
            if named is not self._held and not keeps:
                self._held, self._since = named, 0
        asked = frozenset({Button.TAKE_OVER} if self._held is Driver.TEACHER else ())
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
