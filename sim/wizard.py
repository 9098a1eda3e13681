"""The wizard of Oz: drives like a half-trained policy, for the calibration set.

It follows the oracle's wheel with slowly varying errors, and now and then heads for a decoy (a
block, or a point beside the ball) until it recovers, late. The paper says only that its twelve
rollouts are "representative examples of DAgger rollouts".
"""

from dataclasses import dataclass
from math import exp, hypot, sqrt

import numpy as np

from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.geometry import Pose2D, bearing_rad
from steerlab.sim.ground_truth import Planner
from steerlab.sim.vehicle import WHEEL_LIMIT

DECOY_GAIN = 2.5  # wheel per radian of heading error towards the decoy
DECOY_WHEEL_LIMIT = 1.6  # a mistaken policy still turns gently
LOOK_AHEAD_M = 45.0  # blocks further off are no decoys
# How far beside the ball it aims when it misses: outside its turning circle.
MISS_BY_M = (9.0, 13.0)
MISS_BEYOND_M = 15.0
MISS_WITHIN_M = 30.0  # from the ball, where a policy that misses starts to
MISSED_RAD = 1.5  # bearing of a ball that has been passed
CHANGE_OF_MIND_S = 0.25  # time constant of going from one aim to another


@dataclass(frozen=True, kw_only=True)
class WizardStyle:
    """Parameters of one way of driving badly.

    Attributes:
        gain: share of the oracle's wheel it applies; below 1 it recovers late.
        error_wheel: standard deviation of its slowly varying error, in wheel units.
        error_time_s: correlation time of that error: small weaves, large drifts.
        decoy: what it heads for when it errs: "block", "ball" (a point beside it) or "none".
        err_s: how long it heads for a block.
        sane_s: how long it drives well in between.
    """

    gain: float = 1.0
    error_wheel: float = 0.5
    error_time_s: float = 1.5
    decoy: str = "none"
    err_s: float = 3.0
    sane_s: float = 4.0


class WizardOfOzPolicy:
    """A policy for ``record_rollout``; all its randomness comes from ``rng``."""

    def __init__(
        self, style: WizardStyle, planner: Planner, control_hz: float, rng: np.random.Generator
    ) -> None:
        self._style = style
        self._planner = planner
        self._dt_s = 1.0 / control_hz
        self._rng = rng
        self._error = self._raw_error = float(rng.normal(0.0, style.error_wheel))
        self._erring = 0.0  # how much of the wheel is the decoy's, 0 to 1
        self._until_s = style.sane_s * float(rng.uniform(0.3, 1.0))
        self._aim: tuple[float, float] | None = None  # the decoy last headed for
        self._fooled = False
        self._has_missed = False

    def __call__(self, state: DrivingState) -> float:
        """Wheel position in [-2.5, 2.5].

        Raises:
            NoPath: it has driven itself to where the oracle knows no way.
        """
        speed_mps = float(state.velocity[0])
        oracle = self._planner.label(state.pose, speed_mps)
        self._drift()
        self._choose(state)
        wheel = self._style.gain * oracle
        self._erring += self._dt_s / (self._dt_s + CHANGE_OF_MIND_S) * (self._fooled - self._erring)
        if self._aim is not None:
            wheel += self._erring * (self._towards(self._aim, state.pose) - wheel)
        return float(np.clip(wheel + self._error, -WHEEL_LIMIT, WHEEL_LIMIT))

    def _drift(self) -> None:
        """An Ornstein-Uhlenbeck process, smoothed once more so that the wheel does not tremble."""
        keep = exp(-self._dt_s / self._style.error_time_s)
        # Two equal low passes in a row halve the variance.
        fresh = self._style.error_wheel * sqrt(2.0 * (1.0 - keep * keep))
        self._raw_error = keep * self._raw_error + fresh * float(self._rng.normal())
        self._error = keep * self._error + (1.0 - keep) * self._raw_error

    def _choose(self, state: DrivingState) -> None:
        if self._style.decoy == "ball":
            self._miss_once(state.pose)
        elif self._style.decoy == "block" and state.t_s >= self._until_s:
            block = None if self._fooled else self._block_ahead(state.pose)
            self._fooled, self._aim = block is not None, block or self._aim
            length_s = self._style.err_s if self._fooled else self._style.sane_s
            self._until_s = state.t_s + length_s * float(self._rng.uniform(0.6, 1.4))

    def _miss_once(self, pose: Pose2D) -> None:
        """Near the ball, aim beside it; stop doing so once the ball lies behind the car."""
        ball_x_m, ball_y_m = self._planner.world.ball_xy_m
        to_ball_x_m, to_ball_y_m = ball_x_m - pose.x_m, ball_y_m - pose.y_m
        distance_m = hypot(to_ball_x_m, to_ball_y_m)
        if self._fooled:
            self._has_missed = abs(bearing_rad(pose, (ball_x_m, ball_y_m))) > MISSED_RAD
            self._fooled = not self._has_missed
        elif not self._has_missed and distance_m < MISS_WITHIN_M:
            aside = float(self._rng.uniform(*MISS_BY_M) * self._rng.choice((-1, 1))) / distance_m
            beyond = 1.0 + MISS_BEYOND_M / distance_m
            self._aim = (
                pose.x_m + beyond * to_ball_x_m - aside * to_ball_y_m,
                pose.y_m + beyond * to_ball_y_m + aside * to_ball_x_m,
            )
            self._fooled = True

    def _block_ahead(self, pose: Pose2D) -> tuple[float, float] | None:
        """The centre of one of the blocks ahead, if there are any."""
        ahead = [
            (block.x_m, block.y_m)
            for block in self._planner.world.blocks
            if hypot(block.x_m - pose.x_m, block.y_m - pose.y_m) < LOOK_AHEAD_M
            and abs(bearing_rad(pose, (block.x_m, block.y_m))) < 0.8
        ]
        return ahead[int(self._rng.integers(len(ahead)))] if ahead else None

    def _towards(self, point: tuple[float, float], pose: Pose2D) -> float:
        wheel = DECOY_GAIN * bearing_rad(pose, point)
        return min(DECOY_WHEEL_LIMIT, max(-DECOY_WHEEL_LIMIT, wheel))
