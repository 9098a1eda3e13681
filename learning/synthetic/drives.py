"""Artificial DAgger-like drives in the plane (paper, section Synthetic Experiment, Fig. 2 a, b).

The state is the car's position; the action is the angle of the wheel, and a wheel turned by an
angle turns the car by the same angle. The ground truth at each step is the angle by which the car
would have to turn to face the goal. Demonstrators label the drives with a gain and a shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PAPER
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.vehicle import WHEEL_LIMIT


@dataclass(frozen=True, kw_only=True)
class DriveConfig:
    """The paper gives none of these numbers; they are ours.

    Attributes:
        rate_hz: steps a second.
        steps: labelled steps of a drive.
        margin_steps: driven before the first and after the last labelled step, so that a late or
            early demonstrator has something real to respond to there.
        speed_mps: constant.
        goal_m: nearest and farthest distance of the goal from the start.
        recovery_s: the half-trained agent turns towards the goal with this time constant.
        swerve_hz: mean rate at which it swerves for no reason, as an untrained policy does.
        swerve_rad: standard deviation of the angle of a swerve.
        swerve_s: how long a swerve takes.
        largest_truth_rad: drives that leave the goal further to the side are drawn again.
    """

    rate_hz: float = 10.0
    steps: int = 150
    margin_steps: int = 5
    speed_mps: float = 5.0
    goal_m: tuple[float, float] = (100.0, 130.0)
    recovery_s: float = 1.0
    swerve_hz: float = 0.7
    swerve_rad: float = 0.8
    swerve_s: float = 0.4
    largest_truth_rad: float = np.pi / 2.0

    def __post_init__(self) -> None:
        if self.margin_steps < 0:
            raise InvalidConfig(f"margin_steps is {self.margin_steps}; it must not be negative.")
        numbers = {name: value for name, value in vars(self).items() if name != "margin_steps"}
        for name, value in numbers.items():
            if not np.min(value) > 0.0:
                raise InvalidConfig(f"DriveConfig.{name} is {value}; it must be positive.")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SyntheticDrive:
    """One drive; row ``t`` is the state before ``wheel_rad[t]`` acted. Margins are included.

    Attributes:
        position_m: (rows, 2), the state.
        heading_rad: (rows,) which way the car faces, not wrapped.
        wheel_rad: (rows,) the agent's action; the heading of the next row is larger by it.
        truth_rad: (rows,) angle to the goal minus heading, in [-pi, pi).
        margin_steps: rows before and after the labelled ones.
    """

    name: str
    goal_m: FloatArray
    position_m: FloatArray
    heading_rad: FloatArray
    wheel_rad: FloatArray
    truth_rad: FloatArray
    margin_steps: int

    @property
    def labelled(self) -> slice:
        """The rows that demonstrators label."""
        return slice(self.margin_steps, len(self.truth_rad) - self.margin_steps)


def heading_difference_rad(
    position_m: FloatArray, heading_rad: FloatArray, goal_m: FloatArray
) -> FloatArray:
    """How far the car must turn to face the goal, left positive, in [-pi, pi).

    Args:
        position_m: (..., 2).
        heading_rad: (...,).
        goal_m: (2,).
    """
    to_goal = goal_m - position_m
    angle = np.arctan2(to_goal[..., 1], to_goal[..., 0]) - heading_rad
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def sample_drives(
    count: int, seed: int, *, prefix: str, config: DriveConfig | None = None
) -> tuple[SyntheticDrive, ...]:
    """Drives named ``<prefix>-00``, ...; other seeds and other prefixes are independent.

    Raises:
        InvalidConfig: ``count`` is below 1 or ``seed`` is negative.
    """
    if count < 1 or seed < 0:
        raise InvalidConfig(f"{count} drives from seed {seed}; give at least 1 and a seed from 0.")
    config = config or DriveConfig()
    children = np.random.SeedSequence([seed, *prefix.encode()]).spawn(count)
    return tuple(
        _sample_drive(f"{prefix}-{index:02d}", np.random.default_rng(child), config)
        for index, child in enumerate(children)
    )


def _sample_drive(name: str, rng: np.random.Generator, config: DriveConfig) -> SyntheticDrive:
    while True:
        drive = _drive(name, rng, config)
        if np.abs(drive.truth_rad).max() <= config.largest_truth_rad:
            return drive


def _drive(name: str, rng: np.random.Generator, config: DriveConfig) -> SyntheticDrive:
    rows = config.steps + 2 * config.margin_steps
    step_s = 1.0 / config.rate_hz
    bearing = rng.uniform(-np.pi, np.pi)
    goal = rng.uniform(*config.goal_m) * np.array([np.cos(bearing), np.sin(bearing)])
    swerve = _swerves(rng, rows, config)
    position, heading = np.zeros((rows, 2)), np.zeros(rows)
    wheel, truth = np.zeros(rows), np.zeros(rows)
    heading[0] = bearing + rng.normal(0.0, config.swerve_rad / 2.0)
    for row in range(rows):
        truth[row] = heading_difference_rad(position[row], heading[row], goal)
        wheel[row] = truth[row] * step_s / config.recovery_s + swerve[row]
        if row + 1 < rows:
            heading[row + 1] = heading[row] + wheel[row]
            ahead = np.array([np.cos(heading[row + 1]), np.sin(heading[row + 1])])
            position[row + 1] = position[row] + config.speed_mps * step_s * ahead
    return SyntheticDrive(
        name=name,
        goal_m=goal,
        position_m=position,
        heading_rad=heading,
        wheel_rad=wheel,
        truth_rad=truth,
        margin_steps=config.margin_steps,
    )


def _swerves(rng: np.random.Generator, rows: int, config: DriveConfig) -> FloatArray:
    """(rows,) extra wheel angles: now and then a turn of random size, spread over ``swerve_s``."""
    begins = rng.random(rows) < config.swerve_hz / config.rate_hz
    sizes = np.where(begins, rng.normal(0.0, config.swerve_rad, rows), 0.0)
    lasting = max(1, round(config.swerve_s * config.rate_hz))
    return np.convolve(sizes, np.full(lasting, 1.0 / lasting))[:rows]


# Mappers take labels within ±WHEEL_LIMIT. A drive's truth is within a quarter turn and the
# strongest over-corrector multiplies it by 2.5, so with this factor no label is ever clipped:
# one wheel unit is a quarter turn. Ratios, and so improvements, do not depend on it.
WHEEL_PER_RAD = WHEEL_LIMIT / (PAPER.magnitude[1] * DriveConfig().largest_truth_rad)


class Timing(StrEnum):
    """When a demonstrator acts, compared with the ground truth."""

    DELAYED = "delayed"
    ANTICIPATORY = "anticipatory"
    NEITHER = "neither"

    @classmethod
    def of(cls, teacher: ScriptedTeacher) -> "Timing":
        """The timing of a teacher's style."""
        if teacher.style.delay_s == 0.0:
            return cls.NEITHER
        return cls.DELAYED if teacher.style.delay_s > 0.0 else cls.ANTICIPATORY


def respond_rad(teacher: ScriptedTeacher, drive: SyntheticDrive, rate_hz: float) -> FloatArray:
    """The teacher's labels on the drive's labelled steps: the truth shifted, times the gain.

    Raises:
        InvalidConfig: the style is more than a gain and a shift, the shift is not a whole number
            of steps, or it reaches past the drive's margin.
    """
    style = teacher.style
    extras = {n: v for n, v in vars(style).items() if n not in ("gain", "delay_s") and v != 0.0}
    if extras:
        raise InvalidConfig(f"{teacher.name} has {extras}; demonstrators here have gain and delay.")
    shift = round(style.delay_s * rate_hz)
    if abs(shift - style.delay_s * rate_hz) > 1e-9:
        raise InvalidConfig(
            f"{teacher.name} is {style.delay_s} s late: no whole number of steps at {rate_hz} Hz."
        )
    if abs(shift) > drive.margin_steps:
        raise InvalidConfig(
            f"{teacher.name} is {shift} steps late; the drive has {drive.margin_steps} beyond "
            f"its labelled ones. Give DriveConfig a larger margin_steps."
        )
    rows = np.arange(len(drive.truth_rad))[drive.labelled]
    return style.gain * drive.truth_rad[rows - shift]


def label_drives(
    teachers: Sequence[ScriptedTeacher], drives: Sequence[SyntheticDrive], rate_hz: float
) -> list[LabelSeries]:
    """Every teacher's labels on every drive, in wheel units."""
    return [
        LabelSeries(
            person=teacher.name,
            rollout=drive.name,
            rate_hz=rate_hz,
            label=WHEEL_PER_RAD * respond_rad(teacher, drive, rate_hz),
            truth=WHEEL_PER_RAD * drive.truth_rad[drive.labelled],
            valid=np.ones(len(drive.truth_rad[drive.labelled]), dtype=bool),
        )
        for teacher in teachers
        for drive in drives
    ]
