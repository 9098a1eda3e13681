"""How fast the car steps and the camera draws. ``python -m benchmarks.simulation``."""

from statistics import median
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.drive_to_ball import environment
from steerlab.sim.engine.driving import Driving, DrivingConfig
from steerlab.sim.engine.gym_env import DriveToBallEnv
from steerlab.sim.world_generator import generate_world

ROUNDS = 15
STEPS = 400
WORLD = generate_world("benchmark", np.random.default_rng(0))
ENDLESS = DrivingConfig(time_limit_s=1e6)


def run() -> list[Row]:
    """One row a figure."""
    return [*_stepping(), *_drawing()]


def _stepping() -> list[Row]:
    """``Driving``, dm_env and Gymnasium against a bare ``mj_step`` of the same substeps.

    Ways take turns, so that a slow moment of the machine hits them all; medians of the rounds.
    """
    with Driving(WORLD, config=ENDLESS) as driving:
        model, data, substeps = driving.model, driving.data, ENDLESS.substeps
        dm = environment(WORLD, seed=0, config=ENDLESS)
        gym = DriveToBallEnv(WORLD, config=ENDLESS)
        dm.reset()
        gym.reset(seed=0)
        dm_action, gym_action = [0.1], np.full(1, 0.1, np.float32)
        seconds: dict[str, list[float]] = {}
        for _ in range(ROUNDS):
            for name, step in (
                ("raw", lambda: mujoco.mj_step(model, data, substeps)),
                ("Driving", lambda: driving.step(0.1)),
                ("dm_env", lambda: dm.step(dm_action)),
                ("Gymnasium", lambda: gym.step(gym_action)),
            ):
                driving.reset()
                gym.driving.reset()
                started = perf_counter()
                for _ in range(STEPS):
                    step()
                seconds.setdefault(name, []).append(perf_counter() - started)
        dm.close()
        gym.close()
    raw = seconds.pop("raw")
    limits = {"Driving": 0.85, "dm_env": 0.1, "Gymnasium": 0.5}
    return [
        at_least(
            f"{name}: share of raw mj_step(nstep) speed",
            median(bare / own for bare, own in zip(raw, seconds[name], strict=True)),
            limit,
        )
        for name, limit in limits.items()
    ]


def _drawing() -> list[Row]:
    with Driving(WORLD, config=ENDLESS) as driving:
        with Camera(driving.model, driving.data, CameraConfig()) as camera:
            seconds = [_seconds(lambda: (driving.step(0.1), camera.frame())) for _ in range(ROUNDS)]
        per_second = STEPS / median(seconds)
        with Camera(driving.model, driving.data, CameraConfig(width=960, height=540)) as camera:
            large_ms = 1e3 * median(_seconds(camera.frame, 20) / 20 for _ in range(ROUNDS))
    return [
        at_least("step and 64 x 64 frame", per_second, 1000.0, "1/s"),
        at_most("frame of 960 x 540 (60 Hz leaves 16.7)", large_ms, 16.7, "ms"),
    ]


def _seconds(call: Any, count: int = STEPS) -> float:
    call()
    started = perf_counter()
    for _ in range(count):
        call()
    return perf_counter() - started


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
