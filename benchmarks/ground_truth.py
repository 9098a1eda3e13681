"""Is the ground truth fast, near the optimum, calm and drivable? ``python benchmarks/ground_truth.py``.

Ten random worlds, none of them used for tuning; drives run in MuJoCo.
"""

from math import isfinite
from statistics import mean
from time import perf_counter

import numpy as np

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import NoPath
from steerlab.sim.geometry import Pose2D
from steerlab.sim.ground_truth import OracleDriver, Planner, sample_starts
from steerlab.sim.ground_truth.visibility_graph import VisibilityGraph
from steerlab.sim.rollout import Outcome
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.sim.world import WorldSpec
from steerlab.sim.world_generator import generate_world

FIRST_WORLD, WORLDS, STARTS = 300, 10, 25
LABEL_EVERY = 2  # control steps: labels at 10 Hz
FULL_LOCK = 0.999 * WHEEL_LIMIT


def excess_over_optimum(planner: Planner, rng: np.random.Generator, count: int) -> list[float]:
    """Share by which RRT*'s cost-to-go exceeds the exact one, at random free points."""
    exact = VisibilityGraph(planner.free_space, planner.world.ball_xy_m)
    limit_m, excess = planner.world.half_extent_m, []
    while len(excess) < count:
        x_m, y_m = rng.uniform(-limit_m, limit_m, size=2).tolist()
        best_m = exact.cost_to_go_m(x_m, y_m)
        if isfinite(best_m) and best_m > 1.0:
            excess.append(planner.cost_to_go_m(x_m, y_m) / best_m - 1.0)
    return excess


def drive(
    car: Driving, planner: Planner, start: Pose2D, rng: np.random.Generator, noise: float
) -> tuple[Outcome, FloatArray, FloatArray]:
    """Outcome, poses (t, 3) and speeds (t,) of the committed oracle with a wandering wheel."""
    driver = OracleDriver(planner.check_start(start), planner.car, planner.config)
    state = car.reset(start=start)
    poses, speeds, wander = [], [], 0.0
    outcome = Outcome.RUNNING
    while outcome is Outcome.RUNNING:
        state, speed_mps = car.state, float(car.state.velocity[0])
        poses.append((state.pose.x_m, state.pose.y_m, state.pose.heading_rad))
        speeds.append(speed_mps)
        wander = 0.95 * wander + float(rng.normal(0.0, noise))
        outcome = car.step(driver.wheel(state.pose, speed_mps) + wander)
    return outcome, np.array(poses), np.array(speeds)


def closed_loop(car: Driving, planner: Planner, start: Pose2D) -> Outcome:
    """Outcome of driving by fresh labels alone; straight on where there is none."""
    car.reset(start=start)
    outcome = Outcome.RUNNING
    while outcome is Outcome.RUNNING:
        state = car.state
        try:
            wheel = planner.label(state.pose, float(state.velocity[0]))
        except NoPath:
            wheel = 0.0
        outcome = car.step(wheel)
    return outcome


def _warm_up() -> None:
    """Let numba compile or load everything that is timed."""
    world = generate_world("warm-up", np.random.default_rng(1))
    planner = Planner(world, seed=0)
    sample_starts(planner, np.random.default_rng(0), 2)
    planner.label(world.start, 5.0)


def run() -> list[Row]:
    """Measure everything; one row a figure: name, measured, limit, unit, ok."""
    _warm_up()
    build_s: list[float] = []
    excess: list[float] = []
    label_s, labels = 0.0, 0
    changes: dict[str, list[FloatArray]] = {"oracle": [], "perturbed": []}
    wheels: list[FloatArray] = []
    masked = 0
    committed: list[Outcome] = []
    by_label: list[Outcome] = []
    for seed in range(FIRST_WORLD, FIRST_WORLD + WORLDS):
        world: WorldSpec = generate_world(f"bench-{seed}", np.random.default_rng(seed))
        rng = np.random.default_rng((seed, 1))
        began = perf_counter()
        planner = Planner(world, seed=seed)
        build_s.append(perf_counter() - began)
        excess += excess_over_optimum(planner, rng, 500)
        with Driving(world) as car:
            for start in sample_starts(planner, rng, STARTS):
                for kind, noise in (("oracle", 0.0), ("perturbed", 0.25)):
                    outcome, poses, speeds = drive(car, planner, start, rng, noise)
                    if kind == "oracle":
                        committed.append(outcome)
                    began = perf_counter()
                    found = planner.label_rollout(poses[::LABEL_EVERY], speeds[::LABEL_EVERY])
                    label_s += perf_counter() - began
                    labels += len(found.wheel)
                    masked += int((~found.valid).sum())
                    wheels.append(found.wheel[found.valid])
                    change = np.diff(found.wheel)
                    changes[kind].append(change[np.isfinite(change)])
                by_label.append(closed_loop(car, planner, start))
    wheel = np.abs(np.concatenate(wheels))
    label_ms = 1e3 * label_s / labels
    reached = [100.0 * mean(o is Outcome.BALL_REACHED for o in d) for d in (committed, by_label)]
    return [
        at_most("planner built, mean", mean(build_s), 1.0, "s"),
        at_most("planner built, slowest", max(build_s), 1.0, "s"),
        at_most("label, mean", label_ms, 0.3, "ms"),
        at_most("label, as a share of a fresh tree", label_ms / 1e3 / mean(build_s), 0.01, ""),
        at_most("RRT* above the optimum, mean", 100.0 * mean(excess), 0.5, "%"),
        at_most("RRT* above the optimum, most", 100.0 * max(excess), 2.5, "%"),
        at_most("jitter along the oracle", _std(changes["oracle"]), 0.35, "wheel"),
        at_most("jitter along perturbed drives", _std(changes["perturbed"]), 0.35, "wheel"),
        at_most("labels beyond the limit", 100.0 * float((wheel > WHEEL_LIMIT).mean()), 0.0, "%"),
        at_most("labels at full lock", 100.0 * float((wheel >= FULL_LOCK).mean()), 5.0, "%"),
        at_most("steps without a label", 100.0 * masked / labels, 1.0, "%"),
        at_least("accepted starts driven", float(len(committed)), 200.0, ""),
        at_least("committed oracle arrives", reached[0], 100.0, "%"),
        at_least("driving by labels alone arrives", reached[1], 98.0, "%"),
    ]


def _std(changes: list[FloatArray]) -> float:
    return float(np.concatenate(changes).std())


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
