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
MISS_BY_M = (9.0, 13.0)  # how far beside the ball it aims when it misses: outside its turning circle
MISS_BEYOND_M = 15.0
CHANGE_OF_MIND_S = 0.25  # time constant of going from one aim to another


@dataclass(frozen=True, kw_only=True)
class WizardStyle:
    """One way of driving badly.

    Attributes:
        gain: share of the oracle's wheel it applies; below 1 it recovers late.
        error_wheel: standard deviation of its slowly varying error, in wheel units.
        error_time_s: correlation time of that error: small weaves, large drifts.
        decoy: what it heads for when it errs: "block", "ball" (a point beside it) or "none".
        err_s: how long it heads for the decoy.
        sane_s: how long it drives well in between.
    """

    gain: float = 1.0
    error_wheel: float = 0.5
    error_time_s: float = 1.5
    decoy: str = "none"
    err_s: float = 3.0
    sane_s: float = 4.0


class Wizard:
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
        self._decoy: tuple[float, float] | None = None
        self._last_decoy: tuple[float, float] | None = None

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
        if self._decoy is not None:
            self._last_decoy = self._decoy
        share = self._dt_s / (self._dt_s + CHANGE_OF_MIND_S)
        self._erring += share * ((self._decoy is not None) - self._erring)
        if self._last_decoy is not None:
            towards = self._towards(self._last_decoy, state.pose)
            wheel += self._erring * (towards - wheel)
        return float(np.clip(wheel + self._error, -WHEEL_LIMIT, WHEEL_LIMIT))

    def _drift(self) -> None:
        """An Ornstein-Uhlenbeck process, smoothed once more so that the wheel does not tremble."""
        keep = exp(-self._dt_s / self._style.error_time_s)
        # Two equal low passes in a row halve the variance.
        fresh = self._style.error_wheel * sqrt(2.0 * (1.0 - keep * keep))
        self._raw_error = keep * self._raw_error + fresh * float(self._rng.normal())
        self._error = keep * self._error + (1.0 - keep) * self._raw_error

    def _choose(self, state: DrivingState) -> None:
        missed = self._style.decoy == "ball" and self._decoy is not None and self._passed(state)
        if self._style.decoy == "none" or (state.t_s < self._until_s and not missed):
            return
        erring = self._decoy is None
        self._decoy = self._pick(state.pose) if erring else None
        length_s = self._style.err_s if erring else self._style.sane_s
        self._until_s = state.t_s + length_s * float(self._rng.uniform(0.6, 1.4))

    def _passed(self, state: DrivingState) -> bool:
        """Whether the ball lies behind: then even this policy sees that it missed."""
        return abs(bearing_rad(state.pose, self._planner.world.ball_xy_m)) > 1.5

    def _pick(self, pose: Pose2D) -> tuple[float, float] | None:
        """A point near the ball, or the edge of a block ahead; None if no block is ahead."""
        world = self._planner.world
        if self._style.decoy == "ball":
            ball_x_m, ball_y_m = world.ball_xy_m
            aside_m = float(self._rng.uniform(*MISS_BY_M)) * float(self._rng.choice((-1, 1)))
            distance_m = hypot(ball_x_m - pose.x_m, ball_y_m - pose.y_m)
            along_x = (ball_x_m - pose.x_m) / distance_m
            along_y = (ball_y_m - pose.y_m) / distance_m
            return (
                ball_x_m + MISS_BEYOND_M * along_x - aside_m * along_y,
                ball_y_m + MISS_BEYOND_M * along_y + aside_m * along_x,
            )
        ahead = [
            (block.x_m, block.y_m)
            for block in world.blocks
            if hypot(block.x_m - pose.x_m, block.y_m - pose.y_m) < LOOK_AHEAD_M
            and abs(bearing_rad(pose, (block.x_m, block.y_m))) < 0.8
        ]
        return ahead[int(self._rng.integers(len(ahead)))] if ahead else None

    def _towards(self, point: tuple[float, float], pose: Pose2D) -> float:
        wheel = DECOY_GAIN * bearing_rad(pose, point)
        return min(DECOY_WHEEL_LIMIT, max(-DECOY_WHEEL_LIMIT, wheel))
