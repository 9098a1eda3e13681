"""What the loop knows of a drive, whether it is replayed, driven by a policy or by a person."""

from dataclasses import dataclass
from typing import Protocol

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import WorldSpec
from steerlab.teleop.devices.contract import DeviceSample


@dataclass(frozen=True, slots=True)
class DriveFrame:
    """What a display frame shows of a drive.

    Attributes:
        wheel: the car's, in [-2.5, 2.5].
        gate: who drives.
        speed_mps: the car's, forward.
    """

    pose: Pose2D
    wheel: float
    gate: Driver
    speed_mps: float


class Drive(Protocol):
    """Something that goes on in control steps, and that a device labels or steers."""

    @property
    def name(self) -> str:
        """The rollout's name."""
        ...

    @property
    def world(self) -> WorldSpec:
        """Where it takes place."""
        ...

    @property
    def control_hz(self) -> float:
        """Control steps a second."""
        ...

    @property
    def rollout(self) -> Rollout | None:
        """What is replayed; None if the drive comes into being only now."""
        ...

    @property
    def over(self) -> bool:
        """There is no further step."""
        ...

    @property
    def outcome(self) -> Outcome:
        """How it ended; ``RUNNING`` while it is not over."""
        ...

    def begin(self, *, participant: str, attempt: int) -> None:
        """Go back to step 0."""
        ...

    def step(self, step: int, sample: DeviceSample) -> LabelledStep:
        """Take the sample as the label of the state at ``step``, and go on to the next state."""
        ...

    def between(self, fraction: float) -> DriveFrame:
        """A fraction of the way from the last step to the next.

        Before the first step: the start.
        """
        ...
