"""Whether the car's rectangle overlaps a block: exact, where the discs are on the safe side."""

from math import cos, sin

from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import Block, WorldSpec


def overlaps(pose: Pose2D, block: Block, car: CarConfig) -> bool:
    """Separating axes of two rectangles: those of the block, then those of the car.

    Ericson, *Real-Time Collision Detection* (2005), section 4.4, in the plane.
    """
    dx, dy = block.x_m - pose.x_m, block.y_m - pose.y_m
    cosine, sine = cos(pose.heading_rad), sin(pose.heading_rad)
    half_l, half_w = car.length_m / 2.0, car.width_m / 2.0
    c, s = abs(cosine), abs(sine)
    return (
        abs(dx) < block.half_x_m + c * half_l + s * half_w
        and abs(dy) < block.half_y_m + s * half_l + c * half_w
        and abs(cosine * dx + sine * dy) < half_l + c * block.half_x_m + s * block.half_y_m
        and abs(cosine * dy - sine * dx) < half_w + s * block.half_x_m + c * block.half_y_m
    )


def collision(pose: Pose2D, world: WorldSpec, car: CarConfig) -> str | None:
    """What the car at ``pose`` is in: words for a block or the ground's edge, or None."""
    if max(abs(pose.x_m), abs(pose.y_m)) > world.half_extent_m:
        return f"off the ground of ±{world.half_extent_m:g} m"
    for block in world.blocks:
        if overlaps(pose, block, car):
            return f"in {block}"
    return None
