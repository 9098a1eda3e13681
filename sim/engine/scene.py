"""Compose a world's parts into one model with MuJoCo's own ``MjSpec``."""

from collections.abc import Iterator

import mujoco

from steerlab.sim.engine.arena import ground_mjcf
from steerlab.sim.engine.car import car_mjcf
from steerlab.sim.engine.props import ball_mjcf, block_mjcf
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec


def parts(world: WorldSpec, car: CarConfig) -> Iterator[tuple[str, str]]:
    """Name and MJCF of each thing on the ground, in the order in which they are attached.

    The car comes first, so that its joints come first in ``qpos``.
    """
    yield "car", car_mjcf(car)
    yield "ball", ball_mjcf(*world.ball_xy_m)
    for number, block in enumerate(world.blocks):
        yield f"block_{number}", block_mjcf(block, shade=number)


def compose(world: WorldSpec, car: CarConfig) -> mujoco.MjSpec:
    """The scene of ``world`` with the car at the origin; its start is set at reset.

    Each part stands in a body of its own, ``car/``, and its elements' names begin with that:
    ``car/chassis``.
    """
    spec = mujoco.MjSpec.from_string(ground_mjcf(world.half_extent_m))
    for name, mjcf in parts(world, car):
        frame = spec.worldbody.add_body(name=f"{name}/").add_frame()
        spec.attach(mujoco.MjSpec.from_string(mjcf), prefix=f"{name}/", frame=frame)
    return spec
