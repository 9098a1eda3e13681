"""Make the calibration set: record rollouts, and search for those that keep its rules."""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

import numpy as np

from steerlab.sim.engine.driving import Driving, DrivingState
from steerlab.sim.errors import InvalidConfig, NoPath
from steerlab.sim.geometry import Pose2D, bearing_rad
from steerlab.sim.ground_truth import Planner, sample_starts
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.wizard import WizardOfOzPolicy, WizardStyle
from steerlab.sim.world_generator import WorldConfig, generate_world

CALIBRATION_SEED = 12
MAX_TRIES = 300  # starts in a world
MAX_WORLDS = 10
HARD_TURN_WHEEL = 1.85
JUMP_WHEEL = 0.7
WORLDS = WorldConfig(blocks=(20, 30))


@dataclass(frozen=True, kw_only=True)
class CalibrationRules:
    """What a rollout must be like to be shown to people; lengths in control steps.

    Saturated labels hide over-correction, so few may be at full lock; a rollout needs turns to
    both sides, and something to correct.
    """

    steps: tuple[int, int] = (150, 300)
    max_hard: float = 0.2  # share of labels in a turn as tight as paths are planned
    start_to_ball_m: tuple[float, float] = (40.0, 58.0)
    max_start_bearing_rad: float = 1.2  # of the ball, so that no rollout starts with a U-turn
    max_jumps: int = 2  # labels that change by more than JUMP_WHEEL in one step: routes flip
    min_each_side: float = 0.15  # share of steps with a label beyond ±0.15 on either side
    min_mean_error: float = 0.35  # mean |robot wheel - oracle label|
    must_miss: bool = False  # drives past the ball

    def accept_start(self, start: Pose2D, ball_xy_m: tuple[float, float]) -> bool:
        """Whether a rollout may start here."""
        nearest_m, farthest_m = self.start_to_ball_m
        distance_m = hypot(start.x_m - ball_xy_m[0], start.y_m - ball_xy_m[1])
        turn_rad = abs(bearing_rad(start, ball_xy_m))
        return nearest_m <= distance_m <= farthest_m and turn_rad <= self.max_start_bearing_rad

    def accept(self, rollout: Rollout) -> bool:
        """Whether the rollout keeps every rule."""
        if self.must_miss and not drove_past_ball(rollout):
            return False
        if not self.steps[0] <= rollout.steps <= self.steps[1]:
            return False
        if not rollout.oracle_valid.all() or rollout.outcome is Outcome.OUT_OF_BOUNDS:
            return False
        label = rollout.oracle_label
        left, right = (label > 0.15).mean(), (label < -0.15).mean()
        return bool(
            hard_share(label) <= self.max_hard
            and min(left, right) >= self.min_each_side
            and (np.abs(np.diff(label)) > JUMP_WHEEL).sum() <= self.max_jumps
            and np.abs(rollout.robot_wheel - label).mean() >= self.min_mean_error
        )


RULES = CalibrationRules()
# Turning back takes a long hard turn, to the left or to the right as the car happens to stand.
RULES_OF_A_MISS = CalibrationRules(must_miss=True, max_hard=0.55, max_jumps=4)

WEAVES = WizardStyle(error_wheel=0.9, error_time_s=0.6)
DRIFTS = WizardStyle(error_wheel=0.7, error_time_s=3.0)
RECOVERS_LATE = WizardStyle(gain=0.35, error_wheel=0.6, error_time_s=1.5)
HEADS_FOR_BLOCKS = WizardStyle(decoy="block", error_wheel=0.3, err_s=2.5)
WAVERS = WizardStyle(
    decoy="block", gain=0.7, error_wheel=0.5, error_time_s=1.0, err_s=1.5, sane_s=2.0
)
MISSES = WizardStyle(decoy="ball", error_wheel=0.4, error_time_s=1.0)

STYLES_BY_WORLD = (
    (WEAVES, HEADS_FOR_BLOCKS),
    (DRIFTS, RECOVERS_LATE),
    (MISSES, WAVERS),
    (HEADS_FOR_BLOCKS, WEAVES),
    (RECOVERS_LATE, DRIFTS),
    (WAVERS, HEADS_FOR_BLOCKS),
)


def hard_share(labels: np.ndarray) -> float:
    """Share of labels at or beyond the plateau of a turn at the planned radius.

    Full lock itself is rarer: planned turns leave the wheel some reserve.
    """
    return float((np.abs(labels) > HARD_TURN_WHEEL).mean())


def drove_past_ball(rollout: Rollout, by_m: float = 3.0) -> bool:
    """Whether the car came near the ball and then got further from it again by ``by_m``."""
    distance_m = np.hypot(*(rollout.pose[:, :2] - rollout.world.ball_xy_m).T)
    nearest = int(distance_m.argmin())
    return bool(
        distance_m[nearest] < 15.0 and distance_m[nearest:].max() > distance_m[nearest] + by_m
    )


def generate_calibration_set(
    seed: int = CALIBRATION_SEED,
    rules: CalibrationRules | None = None,
    on_rollout: Callable[[int, int], None] | None = None,
) -> tuple[Rollout, ...]:
    """Drive in six worlds until each has two rollouts, in the styles meant for it, that keep the rules.

    Args:
        rules: in place of ``RULES`` and ``RULES_OF_A_MISS``.
        on_rollout: called with (rollouts found, rollouts wanted).

    Raises:
        InvalidConfig: a style found no rollout in ``MAX_TRIES`` tries; loosen the rules.
    """
    rollouts: list[Rollout] = []
    streams = np.random.SeedSequence(seed).spawn(len(STYLES_BY_WORLD))
    for number, (styles, stream) in enumerate(zip(STYLES_BY_WORLD, streams, strict=True)):
        rollouts += _rollouts_of_a_world(number, styles, stream, rules)
        if on_rollout is not None:
            on_rollout(len(rollouts), len(styles) * len(STYLES_BY_WORLD))
    return tuple(rollouts)


def _rollouts_of_a_world(
    number: int,
    styles: tuple[WizardStyle, ...],
    stream: np.random.SeedSequence,
    rules: CalibrationRules | None,
) -> list[Rollout]:
    """One rollout in each style; a world that does not give them is replaced by another."""
    for world_stream in stream.spawn(MAX_WORLDS):
        world_rng, start_rng, wizard_rng = map(np.random.default_rng, world_stream.spawn(3))
        world = generate_world(f"calibration-{number}", world_rng, WORLDS)
        planner = Planner(world, seed=number)
        rollouts: list[Rollout] = []
        with Driving(world) as driving:
            for attempt in range(MAX_TRIES):
                style = styles[len(rollouts)]
                kept = rules or (RULES_OF_A_MISS if style is MISSES else RULES)
                (start,) = sample_starts(
                    planner, start_rng, 1, min_to_ball_m=kept.start_to_ball_m[0]
                )
                if not kept.accept_start(start, world.ball_xy_m):
                    continue
                try:
                    rollout = record_rollout(
                        driving,
                        WizardOfOzPolicy(style, planner, driving.config.control_hz, wizard_rng),
                        planner,
                        name=f"calibration-{number * len(styles) + len(rollouts):02d}",
                        seed=attempt,
                        start=start,
                        max_steps=kept.steps[1],
                    )
                except NoPath:  # drove itself into a dead end: not a rollout to show
                    continue
                if kept.accept(rollout):
                    rollouts.append(rollout)
                if len(rollouts) == len(styles):
                    return rollouts
    raise InvalidConfig(
        f"No {MAX_TRIES} starts in {MAX_WORLDS} worlds gave {len(styles)} rollouts that "
        f"keep the rules for world {number}; loosen CalibrationRules or take another seed."
    )


Policy = Callable[[DrivingState], float]


def record_rollout(
    driving: Driving,
    policy: Policy,
    planner: Planner,
    *,
    name: str,
    seed: int,
    start: Pose2D,
    max_steps: int | None = None,
) -> Rollout:
    """Drive from ``start`` until the drive ends, or ``max_steps``, then label every step.

    Args:
        policy: wheel position for a state.
        seed: what the policy was made from, kept with the rollout.
    """
    states, wheels, physics = [], [], []
    state = driving.reset(start=start)
    while state.outcome is Outcome.RUNNING and len(states) != max_steps:
        wheel = policy(state)
        states.append(state)
        wheels.append(wheel)
        physics.append(driving.physics_state())
        driving.step(wheel)
        state = driving.state
    outcome = Outcome.TIME_LIMIT if state.outcome is Outcome.RUNNING else state.outcome
    pose = np.array([(s.pose.x_m, s.pose.y_m, s.pose.heading_rad) for s in states])
    velocity = np.array([s.velocity for s in states])
    labels = planner.label_rollout(pose, velocity[:, 0])
    return Rollout(
        name=name,
        world=driving.world,
        control_hz=driving.config.control_hz,
        seed=seed,
        outcome=outcome,
        t_s=np.arange(len(states)) / driving.config.control_hz,
        pose=pose,
        velocity=velocity,
        acceleration=np.array([s.acceleration for s in states]),
        robot_wheel=np.array(wheels, dtype=np.float64),
        oracle_label=labels.wheel,
        oracle_valid=labels.valid,
        physics_state=np.array(physics),
    )
