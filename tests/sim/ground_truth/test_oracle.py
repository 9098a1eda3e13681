"""The committed oracle, and driving by labels alone, in MuJoCo."""

import numpy as np
import pytest

from steerlab.sim.engine.driving import Driving
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import OracleDriver, Planner, sample_starts
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.sim.world_generator import generate_world


def _outcomes(seed: int, count: int) -> list[Outcome]:
    world = generate_world("oracle", np.random.default_rng(seed))
    planner = Planner(world, seed=seed)
    outcomes = []
    with Driving(world) as car:
        for start in sample_starts(planner, np.random.default_rng(seed), count):
            driver = OracleDriver(planner.check_start(start), planner.car, planner.config)
            car.reset(start=start)
            outcome = Outcome.RUNNING
            while outcome is Outcome.RUNNING:
                state = car.state
                wheel = driver.wheel(state.pose, float(state.velocity[0]))
                assert abs(wheel) <= WHEEL_LIMIT
                outcome = car.step(wheel)
            outcomes.append(outcome)
    return outcomes


@pytest.mark.parametrize("seed", [60, 61])
def test_reaches_the_ball_from_accepted_starts(seed: int) -> None:
    assert set(_outcomes(seed, 6)) == {Outcome.BALL_REACHED}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(70, 80))
def test_reaches_the_ball_from_200_accepted_starts(seed: int) -> None:
    assert set(_outcomes(seed, 20)) == {Outcome.BALL_REACHED}


def test_labels_alone_lead_to_the_ball(random_planner: Planner) -> None:
    with Driving(random_planner.world) as car:
        for start in sample_starts(random_planner, np.random.default_rng(3), 3):
            car.reset(start=start)
            outcome = Outcome.RUNNING
            while outcome is Outcome.RUNNING:
                state = car.state
                outcome = car.step(random_planner.label(state.pose, float(state.velocity[0])))
            assert outcome is Outcome.BALL_REACHED


def test_labels_along_a_wandering_drive_stay_calm(random_planner: Planner) -> None:
    """Jitter as in the paper's terms: std of the first difference of 10 Hz labels."""
    rng = np.random.default_rng(4)
    changes = []
    with Driving(random_planner.world) as car:
        for start in sample_starts(random_planner, rng, 4):
            path = random_planner.check_start(start)
            driver = OracleDriver(path, random_planner.car, random_planner.config)
            car.reset(start=start)
            rows, speeds, wander = [], [], 0.0
            outcome = Outcome.RUNNING
            while outcome is Outcome.RUNNING:
                pose, speed_mps = car.state.pose, float(car.state.velocity[0])
                rows.append((pose.x_m, pose.y_m, pose.heading_rad))
                speeds.append(speed_mps)
                wander = 0.95 * wander + float(rng.normal(0.0, 0.25))
                outcome = car.step(driver.wheel(pose, speed_mps) + wander)
            found = random_planner.label_rollout(np.array(rows)[::2], np.array(speeds)[::2])
            change = np.diff(found.wheel)
            changes.append(change[np.isfinite(change)])
    assert np.concatenate(changes).std() <= 0.35


def test_a_plan_starts_where_the_rear_axle_is(random_planner: Planner) -> None:
    start: Pose2D = sample_starts(random_planner, np.random.default_rng(9), 1)[0]
    rear = start.ahead(-random_planner.car.wheelbase_m / 2)
    path = random_planner.plan(start)
    np.testing.assert_allclose(path.points[0], (rear.x_m, rear.y_m), atol=1e-9)
    assert path.heading[0] == pytest.approx(start.heading_rad)
