"""Decides whether a drive is over; one rule for the fast interface and the dm_control task.

A grazing contact lasts a single physics step of 10 ms, so it must be looked for after each of them.
"""

from math import hypot

import mujoco

from steerlab.sim.engine.car_state import floats
from steerlab.sim.rollout import Outcome
from steerlab.sim.world import REACH_M, WorldSpec


class Referee:
    """Looks at the car's position and contacts; only chassis and blocks can touch each other."""

    def __init__(self, data: mujoco.MjData, world: WorldSpec) -> None:
        self._data = data
        self._qpos = floats(data.qpos)
        self._ball_x_m, self._ball_y_m = world.ball_xy_m
        self._half_extent_m = world.half_extent_m

    def distance_to_ball_m(self) -> float:
        """From the car's centre to the ball's centre."""
        return hypot(self._qpos[0] - self._ball_x_m, self._qpos[1] - self._ball_y_m)

    def near_block(self) -> bool:
        """Whether a block is within ``NEAR_BLOCK_M``: only then can the next control step hit one."""
        return self._data.ncon > 0

    def touching(self) -> bool:
        """Whether the car touched a block in the last physics step."""
        return self._data.ncon > 0 and bool(self._data.contact.dist.min() < 0.0)

    def verdict(self, touched: bool) -> Outcome:
        """The outcome now, apart from the time limit.

        Args:
            touched: whether the car touched a block in any physics step of this control step.
        """
        if touched:
            return Outcome.BLOCK_HIT
        if self.distance_to_ball_m() < REACH_M:
            return Outcome.BALL_REACHED
        if max(abs(self._qpos[0]), abs(self._qpos[1])) > self._half_extent_m:
            return Outcome.OUT_OF_BOUNDS
        return Outcome.RUNNING
