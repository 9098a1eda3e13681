"""Drives to pre-train on: other worlds and other starts than the calibration set's, made by seed."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from steerlab.learning.pretrained.teachers import PretrainingDrive
from steerlab.sim.calibration_generator import (
    STYLES_BY_WORLD,
    WORLDS,
    CalibrationRules,
    record_rollout,
)
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig, NoPath
from steerlab.sim.ground_truth import Planner, sample_starts
from steerlab.sim.wizard import WizardOfOzPolicy, WizardStyle
from steerlab.sim.world_generator import generate_world

_STREAM = 0x0D21  # keeps these seeds apart from the calibration set's, which is SeedSequence(12)
_TRIES_A_DRIVE = 20

# Looser than the calibration set's own rules: what is learned must hold outside it too.
RULES = CalibrationRules(
    steps=(120, 300),
    max_hard=0.6,
    start_to_ball_m=(35.0, 62.0),
    max_start_bearing_rad=1.5,
    max_jumps=4,
    min_each_side=0.08,
    min_mean_error=0.2,
)


def generate_drives(
    seed: int,
    worlds: int,
    drives_per_world: int,
    on_world: Callable[[int, int], None] | None = None,
) -> list[PretrainingDrive]:
    """Drive the wizard in ``worlds`` new worlds, in the calibration set's styles made random.

    Args:
        on_world: called with (worlds done, worlds).

    Raises:
        InvalidConfig: fewer than one world or drive was asked for.
    """
    if worlds < 1 or drives_per_world < 1:
        raise InvalidConfig(f"{worlds} worlds of {drives_per_world} drives are none; give both.")
    drives: list[PretrainingDrive] = []
    for number, stream in enumerate(np.random.SeedSequence([_STREAM, seed]).spawn(worlds)):
        drives += _drives_of_a_world(number, stream, drives_per_world)
        if on_world is not None:
            on_world(number + 1, worlds)
    return drives


def _drives_of_a_world(
    number: int, stream: np.random.SeedSequence, count: int
) -> Iterator[PretrainingDrive]:
    world_rng, start_rng, wizard_rng = map(np.random.default_rng, stream.spawn(3))
    world = generate_world(f"pretraining-{number}", world_rng, WORLDS)
    planner = Planner(world, seed=number)
    kept = 0
    with Driving(world) as driving:
        for _ in range(_TRIES_A_DRIVE * count):  # a crowded world may give fewer
            if kept == count:
                return
            (start,) = sample_starts(planner, start_rng, 1, min_to_ball_m=RULES.start_to_ball_m[0])
            if not RULES.accept_start(start, world.ball_xy_m):
                continue
            wizard = WizardOfOzPolicy(
                _style(wizard_rng), planner, driving.config.control_hz, wizard_rng
            )
            try:
                rollout = record_rollout(
                    driving,
                    wizard,
                    planner,
                    name=f"pretraining-{number}-{kept}",
                    seed=number,
                    start=start,
                    max_steps=RULES.steps[1],
                )
            except NoPath:  # drove itself into a dead end
                continue
            if RULES.accept(rollout):
                kept += 1
                yield PretrainingDrive.from_rollout(rollout)


def _style(rng: np.random.Generator) -> WizardStyle:
    styles = STYLES_BY_WORLD[int(rng.integers(len(STYLES_BY_WORLD)))]
    style = styles[int(rng.integers(len(styles)))]
    return replace(
        style,
        gain=style.gain * float(np.exp(rng.normal(0.0, 0.2))),
        error_wheel=style.error_wheel * float(np.exp(rng.normal(0.0, 0.3))),
        error_time_s=style.error_time_s * float(np.exp(rng.normal(0.0, 0.3))),
    )
