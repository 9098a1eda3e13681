"""Poses from which the ball can be reached, plan and drive included."""

from math import hypot, pi

import numpy as np

from steerlab.sim.errors import NoPath
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth.planner import Planner

TRIES_PER_START = 200


def sample_starts(
    planner: Planner, rng: np.random.Generator, count: int, *, min_to_ball_m: float = 20.0
) -> list[Pose2D]:
    """Draw poses anywhere on the ground, and keep those that ``Planner.check_start`` accepts.

    Args:
        planner: of the world to start in.
        rng: where the poses come from.
        count: how many starts are wanted.
        min_to_ball_m: from the car's centre to the ball's.

    Raises:
        NoPath: too few were found; the world leaves hardly any room.
    """
    limit_m = planner.world.half_extent_m
    ball_x_m, ball_y_m = planner.world.ball_xy_m
    starts: list[Pose2D] = []
    reason = "pose_in_collision"
    for _ in range(TRIES_PER_START * count):
        if len(starts) == count:
            return starts
        x_m, y_m = (float(value) for value in rng.uniform(-limit_m, limit_m, size=2))
        pose = Pose2D(x_m, y_m, float(rng.uniform(-pi, pi)))
        if hypot(x_m - ball_x_m, y_m - ball_y_m) < min_to_ball_m:
            continue
        try:
            planner.check_start(pose)
        except NoPath as error:
            reason = error.reason
            continue
        starts.append(pose)
    if len(starts) == count:
        return starts
    raise NoPath(
        reason,
        f"World {planner.world.name!r}: only {len(starts)} of {count} starts found at least "
        f"{min_to_ball_m:g} m from the ball; ask for fewer, nearer ones, or remove blocks.",
    )
