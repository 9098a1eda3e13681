"""A drive that comes into being while it is watched: a policy's, a person's, or both in turn."""

from collections.abc import Callable

from steerlab.sim.engine.driving import Driving, DrivingState
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import WorldSpec
from steerlab.teleop.devices.contract import DeviceSample
from steerlab.teleop.drives.contract import DriveFrame
from steerlab.teleop.drives.replay import interpolate
from steerlab.teleop.drives.who_drives import Command, WhoDrives

Policy = Callable[[DrivingState], float]
Oracle = Callable[[DrivingState], float | None]


class LiveDrive:
    """Corrected or taken over while it goes on, through the same loop as a replay.

    Args:
        driving: the car in its world; the caller closes it.
        policy: the robot's wheel for a state.
        who: decides in each step whose wheel the car gets.
        oracle: the ground truth of a state, kept beside the label; None where there is no way.
        start: where each attempt begins; the world's start by default.
    """

    def __init__(
        self,
        name: str,
        driving: Driving,
        policy: Policy,
        who: WhoDrives,
        *,
        oracle: Oracle | None = None,
        start: Pose2D | None = None,
    ) -> None:
        self._name = name
        self._driving = driving
        self._policy = policy
        self._who = who
        self._oracle = oracle
        self._start = start or driving.world.start
        self._participant, self._attempt = "", 0
        self._state = driving.reset(start=self._start)
        self._before = self._state
        self._command = Command(Driver.ROBOT, 0.0)

    @property
    def name(self) -> str:
        """The rollout's name."""
        return self._name

    @property
    def world(self) -> WorldSpec:
        """Where it is driven."""
        return self._driving.world

    @property
    def control_hz(self) -> float:
        """Control steps a second."""
        return self._driving.config.control_hz

    @property
    def rollout(self) -> Rollout | None:
        """None: there is no rollout before it was driven."""
        return None

    @property
    def over(self) -> bool:
        """The drive has an outcome."""
        return self._state.outcome is not Outcome.RUNNING

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        return self._state.outcome

    def begin(self, *, participant: str, attempt: int) -> None:
        """Put the car back to the start."""
        self._participant, self._attempt = participant, attempt
        self._who.begin()
        self._state = self._before = self._driving.reset(start=self._start)
        self._command = Command(Driver.ROBOT, 0.0)

    def step(self, step: int, sample: DeviceSample) -> LabelledStep:
        """Label the state, let the car go on by one step; no sleep, no clock.

        Raises:
            DeviceError: the person drives and the device says nothing.
        """
        state = self._state
        robot_wheel = float(self._policy(state))
        command = self._who.command(robot_wheel, sample)
        self._driving.step(command.wheel, command.throttle, command.brake)
        self._before, self._state = state, self._driving.state
        self._command = command
        forward, slip, yaw_rate = state.velocity.tolist()
        acceleration_x, acceleration_y = state.acceleration.tolist()
        return LabelledStep(
            participant=self._participant,
            rollout=self._name,
            attempt=self._attempt,
            step=step,
            t_s=state.t_s,
            x_m=state.pose.x_m,
            y_m=state.pose.y_m,
            heading_rad=state.pose.heading_rad,
            speed_mps=forward,
            lateral_speed_mps=slip,
            yaw_rate_radps=yaw_rate,
            acceleration_x_mps2=acceleration_x,
            acceleration_y_mps2=acceleration_y,
            robot_wheel=robot_wheel,
            teacher_label=sample.wheel if sample.ok else None,
            oracle_label=None if self._oracle is None else self._oracle(state),
            executed_wheel=command.wheel,
            gate=command.gate,
            label_valid=sample.ok and sample.wheel is not None,
        )

    def between(self, fraction: float) -> DriveFrame:
        """Between the states before and after the last step, which physics has done already."""
        pose = interpolate(self._before.pose, self._state.pose, fraction)
        speed_mps = float(self._state.velocity[0])
        return DriveFrame(pose, self._command.wheel, self._command.gate, speed_mps)
