"""A recorded rollout, shown again: nothing that the participant does changes it."""

from steerlab.sim.geometry import Pose2D, wrap_angle
from steerlab.sim.records import Driver, LabelledStep, labelled_step
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import WorldSpec
from steerlab.teleop.devices.contract import DeviceSample
from steerlab.teleop.drives.contract import DriveFrame


class Replay:
    """Replay-and-correct: the wheel's position is the label for the state at the same step."""

    def __init__(self, rollout: Rollout) -> None:
        self._rollout = rollout
        self._participant, self._attempt, self._next = "", 0, 0

    @property
    def name(self) -> str:
        """The rollout's name."""
        return self._rollout.name

    @property
    def world(self) -> WorldSpec:
        """Where it was driven."""
        return self._rollout.world

    @property
    def control_hz(self) -> float:
        """Control steps a second."""
        return self._rollout.control_hz

    @property
    def rollout(self) -> Rollout | None:
        """What is replayed."""
        return self._rollout

    @property
    def over(self) -> bool:
        """All steps were shown."""
        return self._next >= self._rollout.steps

    @property
    def outcome(self) -> Outcome:
        """How the recorded drive ended; ``RUNNING`` until that is shown."""
        return self._rollout.outcome if self.over else Outcome.RUNNING

    def begin(self, *, participant: str, attempt: int) -> None:
        """Go back to step 0."""
        self._participant, self._attempt, self._next = participant, attempt, 0

    def step(self, step: int, sample: DeviceSample) -> LabelledStep:
        """Keep the sample as the label of ``step``; the wheel executed is the recorded one."""
        self._next = step + 1
        return labelled_step(
            self._rollout,
            step,
            sample.wheel if sample.ok else None,
            participant=self._participant,
            attempt=self._attempt,
        )

    def between(self, fraction: float) -> DriveFrame:
        """Recorded states, interpolated linearly in between; exact at a step."""
        last = max(self._next - 1, 0)
        pose = self._rollout.pose_at(last)
        if fraction > 0.0 and 0 < self._next < self._rollout.steps:
            pose = interpolate(pose, self._rollout.pose_at(self._next), fraction)
        wheel, speed_mps = self._rollout.robot_wheel[last], self._rollout.velocity[last, 0]
        return DriveFrame(pose, float(wheel), Driver.ROBOT, float(speed_mps))


def interpolate(here: Pose2D, there: Pose2D, fraction: float) -> Pose2D:
    """The pose a fraction of the way, turning the short way round."""
    turn_rad = wrap_angle(there.heading_rad - here.heading_rad)
    return Pose2D(
        here.x_m + fraction * (there.x_m - here.x_m),
        here.y_m + fraction * (there.y_m - here.y_m),
        here.heading_rad + fraction * turn_rad,
    )
