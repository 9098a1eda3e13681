"""Compose a world's entities into one MJCF."""

from dataclasses import dataclass

from dm_control import composer

from steerlab.sim.engine.arena import Ground
from steerlab.sim.engine.car import Car
from steerlab.sim.engine.props import BallEntity, BlockEntity
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec


@dataclass(frozen=True, slots=True)
class Scene:
    """The composed entities; ``ground.mjcf_model`` is the whole world."""

    ground: Ground
    car: Car
    ball: BallEntity
    blocks: tuple[composer.Entity, ...]


def compose(world: WorldSpec, car: CarConfig) -> Scene:
    """The scene of ``world`` with the car at the origin; its start is set at reset.

    The car is attached first, so that its joints come first in ``qpos``.
    """
    ground = Ground(half_extent_m=world.half_extent_m)
    car_entity = Car(config=car)
    ground.attach(car_entity)
    ball = BallEntity(*world.ball_xy_m)
    ground.attach(ball)
    blocks = tuple(
        BlockEntity(block, shade=number, name=f"block_{number}")
        for number, block in enumerate(world.blocks)
    )
    for block in blocks:
        ground.attach(block)
    return Scene(ground, car_entity, ball, blocks)
