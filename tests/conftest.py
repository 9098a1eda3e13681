"""Rollouts that tests of teachers and of mappers share, and an X server of a test's own."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from steerlab.sim.arrays import FloatArray
from steerlab.sim.geometry import Pose2D
from steerlab.sim.rollout import Outcome, Rollout
from steerlab.sim.world import WorldSpec
from tests.teleop.display import Display

# Programs that tests start keep what Python compiles: without it each compiles PyTorch again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# How long an example takes is a matter of the machine, and of what else it does.
settings.register_profile("steerlab", deadline=None)
settings.load_profile("steerlab")


def _flat_rollout(label: FloatArray, *, name: str = "one", control_hz: float = 20.0) -> Rollout:
    steps = len(label)
    return Rollout(
        name=name,
        world=WorldSpec(name="flat", ball_xy_m=(40.0, 0.0), start=Pose2D(0.0, 0.0, 0.0)),
        control_hz=control_hz,
        seed=0,
        outcome=Outcome.TIME_LIMIT,
        t_s=np.arange(steps) / control_hz,
        pose=np.zeros((steps, 3)),
        velocity=np.zeros((steps, 3)),
        acceleration=np.zeros((steps, 2)),
        robot_wheel=np.zeros(steps),
        oracle_label=label,
        oracle_valid=np.isfinite(label),
        physics_state=np.zeros((steps, 1)),
    )


@pytest.fixture(scope="session")
def make_rollout() -> Callable[..., Rollout]:
    """``make_rollout(label, name=, control_hz=)``: these oracle labels, and a car that stands."""
    return _flat_rollout


@pytest.fixture
def x_display(tmp_path: Path) -> Iterator[str]:
    """What ``DISPLAY`` is to be, for windows that a person sits before."""
    if shutil.which("Xvfb") is None:
        pytest.skip("not installed: Xvfb")
    display = Display(tmp_path)
    yield display.environment["DISPLAY"]
    display.close()
