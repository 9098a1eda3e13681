"""Drive a policy once and keep everything: the rollout, its states and its oracle labels."""

from collections.abc import Callable

import numpy as np

from steerlab.sim.engine.driving import Driving, DrivingState
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import Planner
from steerlab.sim.rollout import Outcome, Rollout

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
