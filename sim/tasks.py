"""Driving tasks that learners are compared on: a world, starts, and noise shared by everyone.

The world runs at its usual 20 Hz; a policy decides at every second control step and its wheel is
held in between, so a decision is worth 0.1 s. Noise is drawn once a decision and added to the
executed wheel, a person's or a robot's.
"""

from dataclasses import dataclass, field, replace
from hashlib import sha256

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import Driving, DrivingConfig, draw_start
from steerlab.sim.errors import InvalidConfig, InvalidWorld, NoPath, shown
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import Planner, PlannerConfig
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import WorldConfig, generate_world

NAMED_TASKS = ("easy", "slalom", "hard")
GENERATED = "generated-"
HELD_STEPS = 2  # control steps a decision lasts
_FARTHEST_M = 78.0  # a generated ball must be within what the time limit lets one drive
_SCREEN_TRIES = 20  # starts drawn for each one wanted
_TRIES = 1000
_LONGEST_NUMBER = 10  # digits of a generated world


@dataclass(frozen=True, kw_only=True)
class Task:
    """A driving task: its world, wheel noise, speed, planning margin and rates.

    Attributes:
        noise: standard deviation of the wheel noise, in wheel units; the paper's follow-up work
            gives 0.2 of full lock, which is 0.5 here.
        margin_m: what the oracle keeps from blocks. The planner's own 0.4 m hugs corners so closely
            that noise and the smallest imitation error end at a block: nothing could be compared.
        driving: rates, time limit (20 s are 200 decisions) and spread of starts.
    """

    name: str
    world: WorldSpec
    noise: float = 0.5
    speed_mps: float = 5.0
    margin_m: float = 1.2
    driving: DrivingConfig = field(default_factory=lambda: DrivingConfig(time_limit_s=20.0))

    def __post_init__(self) -> None:
        if not 0.0 <= self.noise <= WHEEL_LIMIT:
            raise InvalidConfig(
                f"noise is {self.noise}; it is a standard deviation in wheel units, from 0 to "
                f"{WHEEL_LIMIT}."
            )
        if self.driving.max_steps % HELD_STEPS:
            raise InvalidConfig(
                f"time_limit_s {self.driving.time_limit_s} is no whole number of decisions of "
                f"{HELD_STEPS} steps at {self.driving.control_hz} Hz."
            )

    @property
    def car(self) -> CarConfig:
        """The car at the task's speed."""
        return CarConfig(
            cruise_speed_mps=self.speed_mps, max_speed_mps=max(10.0, 2.0 * self.speed_mps)
        )

    @property
    def planning(self) -> PlannerConfig:
        """How ground truth is planned here."""
        return PlannerConfig(margin_m=self.margin_m)

    @property
    def decisions(self) -> int:
        """Decisions until the time limit."""
        return self.driving.max_steps // HELD_STEPS


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where a drive begins and the wheel noise it will meet, (decisions,): equal for everyone."""

    pose: Pose2D
    noise: FloatArray


@dataclass(frozen=True, slots=True)
class Screened:
    """Starts that the noisy oracle reaches the ball from, and how many were drawn for them."""

    starts: tuple[Start, ...]
    drawn: int


def make_task(name: str, *, noise: float = 0.5, speed_mps: float = 5.0) -> Task:
    """A task by name: one of ``NAMED_TASKS``, or ``generated-<number>``, a seeded world.

    Raises:
        InvalidConfig: there is no such task, or the noise is outside what it may be.
    """
    if name in NAMED_TASKS:
        return Task(name=name, world=_named_world(name), noise=noise, speed_mps=speed_mps)
    number = name.removeprefix(GENERATED)
    if name.startswith(GENERATED) and number.isdecimal() and len(number) <= _LONGEST_NUMBER:
        world = generated_world(int(number))
        return Task(name=name, world=world, noise=noise, speed_mps=speed_mps)
    raise InvalidConfig(
        f"No task {shown(name)}; choose one of {', '.join(NAMED_TASKS)}, or {GENERATED}<number> such as "
        f"{GENERATED}3."
    )


def generated_world(number: int) -> WorldSpec:
    """World ``number`` of the family: a few blocks, and a ball that time allows to reach."""
    config = WorldConfig(blocks=(3, 7), min_start_to_ball_m=55.0, half_size_m=(1.5, 4.0))
    rng = np.random.default_rng([number, 0x7A5C])
    for _ in range(_TRIES):
        world = generate_world(f"{GENERATED}{number}", rng, config)
        away_m = np.hypot(
            world.start.x_m - world.ball_xy_m[0], world.start.y_m - world.ball_xy_m[1]
        )
        if away_m <= _FARTHEST_M:
            return world
    raise InvalidWorld(f"No world {GENERATED}{number} found; choose another number.")


def draw_task_start(task: Task, *entropy: object) -> Start:
    """A free start near the world's and its noise; equal ``entropy`` gives equal starts."""
    rng = _rng(task, *entropy)
    pose = draw_start(rng, task.world, task.car, task.driving)
    return Start(pose, draw_noise(task, rng))


def redraw_noise(task: Task, start: Start, *entropy: object) -> Start:
    """A start with the same pose and new noise, for another try."""
    return Start(start.pose, draw_noise(task, _rng(task, "again", *entropy)))


def draw_noise(task: Task, rng: np.random.Generator) -> FloatArray:
    """Wheel noise of a drive, (decisions,), in wheel units."""
    return rng.normal(0.0, task.noise, size=task.decisions)


def screen_starts(
    task: Task, planner: Planner, driving: Driving, count: int, *entropy: object
) -> Screened:
    """Starts from which the noisy oracle reaches the ball; no learner is judged on others.

    Raises:
        InvalidWorld: too few were found.
    """
    kept: list[Start] = []
    most = _SCREEN_TRIES * count
    for drawn in range(most):
        start = draw_task_start(task, "screen", *entropy, drawn)
        if oracle_outcome(task, planner, driving, start) is Outcome.BALL_REACHED:
            kept.append(start)
        if len(kept) == count:
            return Screened(tuple(kept), drawn + 1)
    raise InvalidWorld(
        f"Task {task.name!r}: with noise {task.noise:g} the oracle reached the ball from only "
        f"{len(kept)} of {most} starts, and {count} are needed; lower the noise or choose another "
        f"task."
    )


def oracle_outcome(task: Task, planner: Planner, driving: Driving, start: Start) -> Outcome:
    """How the oracle fares from ``start`` under its noise, deciding as often as learners do."""
    state = driving.reset(start=start.pose)
    for noise in start.noise.tolist():
        try:
            wheel = planner.label(state.pose, float(state.velocity[0]))
        except NoPath:
            return Outcome.BLOCK_HIT  # it has driven itself to where only a contact is left
        for _ in range(HELD_STEPS):
            if driving.step(wheel + noise) is not Outcome.RUNNING:
                return driving.outcome
        state = driving.state
    return driving.outcome


def _rng(task: Task, *entropy: object) -> np.random.Generator:
    digest = sha256(repr((task.name, *entropy)).encode()).digest()
    return np.random.default_rng(list(digest))


def _named_world(name: str) -> WorldSpec:
    start, ball = Pose2D(-40.0, 0.0, 0.0), (34.0, 0.0)
    flat = WorldSpec(name="easy", ball_xy_m=ball, start=start)
    if name == "easy":
        return flat
    if name == "slalom":  # right of the first block, left of the second
        blocks = (_wall(-14.0, -3.0, 20.0), _wall(9.0, -20.0, 3.0))
        return replace(flat, name=name, blocks=blocks)
    blocks = (  # hard: three turns instead of two, and a ball off the axis
        _wall(-20.0, -1.5, 22.0),
        _wall(0.0, -22.0, 1.5),
        _wall(20.0, -1.5, 22.0),
    )
    return replace(flat, name=name, ball_xy_m=(38.0, 2.0), blocks=blocks)


def _wall(x_m: float, low_y_m: float, high_y_m: float) -> Block:
    """A block across the way. Long enough that one way is the shortest from every start.

    With short blocks it depends on the start whether the oracle goes round both on the left or on
    the right, and a policy that is between two right answers is wrong.
    """
    return Block(x_m, (low_y_m + high_y_m) / 2.0, 2.0, (high_y_m - low_y_m) / 2.0)
