"""The practice drive of a scripted participant: headless, in the worlds that people practise in."""

from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.errors import SteerlabError
from steerlab.sim.geometry import bearing_rad
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import DeviceInfo, DeviceSample, InputKind
from steerlab.teleop.drives.live import LiveDrive
from steerlab.teleop.drives.who_drives import PersonDrives
from steerlab.teleop.loop import NullClock, run_drive
from steerlab.teleop.practice import PracticeConfig, PracticeResult, Unrecorded, practice_world

STEER_PER_RAD = 4.0  # wheel for each radian between the car's heading and the ball
THROTTLE = 0.6
MOST_DRIVES = 20  # for each ball; about two of three worlds let the car through


def practise_scripted(config: PracticeConfig) -> PracticeResult:
    """Drive straight at one ball after another, through the loop that people go through.

    Nothing is labelled here, so a script has no style of its own to show; it does not see blocks,
    and after hitting one goes on in the next world.

    Raises:
        SteerlabError: hardly any world lets the car through.
    """
    balls = crashes = 0
    unrecorded, driven_s = Unrecorded(), 0.0
    for number in range(MOST_DRIVES * config.balls):
        world = practice_world(config, number)
        with Driving(world, config=DrivingConfig(time_limit_s=config.time_limit_s)) as driving:
            who = PersonDrives(pedals=config.pedals)
            drive = LiveDrive(world.name, driving, lambda state: 0.0, who)
            run_drive(
                drive,
                _AtTheBall(driving),
                participant="practice",
                order=0,
                clock=NullClock(),
                sink=unrecorded,
            )
            balls += drive.outcome is Outcome.BALL_REACHED
            crashes += drive.outcome is Outcome.BLOCK_HIT
            driven_s = unrecorded.steps / drive.control_hz
        if config.enough(balls, driven_s):
            return PracticeResult(balls=balls, crashes=crashes, driven_s=driven_s, stopped=False)
    raise SteerlabError(
        f"A script reached {balls} of {config.balls} balls in {MOST_DRIVES * config.balls} "
        f"practice drives; raise practice.time_limit_s ({config.time_limit_s:g} s)."
    )


class _AtTheBall:
    """A device whose wheel points at the ball."""

    info = DeviceInfo(kind=InputKind.SCRIPTED, name="straight at the ball")

    def __init__(self, driving: Driving) -> None:
        self._driving = driving

    def connect(self) -> None:
        """Nothing to open."""

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Nothing to get ready."""

    def read(self, step: int | None = None) -> DeviceSample:
        """Where the ball is, as seen from the car."""
        world, pose = self._driving.world, self._driving.state.pose
        wheel = STEER_PER_RAD * bearing_rad(pose, world.ball_xy_m)
        wheel = max(-WHEEL_LIMIT, min(WHEEL_LIMIT, wheel))
        return DeviceSample(wheel=wheel, throttle=THROTTLE, brake=0.0)

    def disconnect(self) -> None:
        """Nothing to close."""
