"""The MJCF of a world, composed into one model with MuJoCo's own ``MjSpec``.

The ground is a square with a line around it, a sky and one light that casts no shadow; on it stand
the car, the blocks to avoid and the ball to reach.
"""

from collections.abc import Iterator

import mujoco

from steerlab.sim.engine.car import SHADOW_RGBA, USERDATA_SIZE, car_mjcf, numbers
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M, Block, WorldSpec

PHYSICS_TIMESTEP_S = 0.01
GROUND_TEXTURE_M = 5.0  # side of one checker pair, large enough not to flicker at 64 x 64
# A contact is listed when a block is this near, and pushes only when it touches: so the referee
# knows when to look at every physics step. More than the car moves in a control step.
NEAR_BLOCK_M = 1.0
BLOCK_CONTYPE, BLOCK_CONAFFINITY = 1, 2  # meets the chassis (2, 1) only
BALL_RGBA = "1 0.45 0.05 1"
BLOCK_RGBAS = ("0.27 0.36 0.52 1", "0.36 0.30 0.47 1", "0.24 0.44 0.46 1", "0.45 0.36 0.33 1")


def ground_mjcf(half_extent_m: float) -> str:
    """MJCF of a ground of ``2 * half_extent_m`` a side, plus some more to look at beyond the line.

    It also sets how the whole world is simulated and drawn. ``noslip``, ``boundmass``,
    ``boundinertia`` and the scales are those of dm_control's arenas, in which the shipped rollouts
    were recorded.
    """
    shown_m = 4.0 * half_extent_m
    repeat = 2 * shown_m / GROUND_TEXTURE_M
    # The third size of the plane is the spacing of the drawn grid: equal to the extent it costs
    # 3 ms less. The clip distances are times the extent: 0.25 m to 500 m.
    return f"""
<mujoco model="ground">
  <compiler angle="radian" boundmass="1e-5" boundinertia="1e-11"/>
  <option timestep="{PHYSICS_TIMESTEP_S}" integrator="implicitfast" solver="Newton"
    cone="pyramidal" iterations="20" ls_iterations="10" noslip_iterations="5" noslip_tolerance="0"/>
  <size nuserdata="{USERDATA_SIZE}"/>
  <statistic center="0 0 0" extent="50"/>
  <visual>
    <quality shadowsize="0" numslices="20" numstacks="12" numquads="1"/>
    <headlight ambient="0.45 0.45 0.45" diffuse="0.2 0.2 0.2" specular="0 0 0"/>
    <map znear="0.005" zfar="10"/>
    <scale forcewidth="0.01" contactwidth="0.06" contactheight="0.01" jointwidth="0.01"
      framelength="0.3" framewidth="0.01"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.45 0.62 0.80"
      rgb2="0.86 0.91 0.95" width="64" height="64"/>
    <texture name="ground" type="2d" builtin="checker" rgb1="0.56 0.58 0.55"
      rgb2="0.50 0.52 0.50" width="128" height="128"/>
    <material name="ground" texture="ground" texrepeat="{numbers(repeat, repeat)}" reflectance="0"/>
  </asset>
  <worldbody>
    <light name="sun" directional="true" castshadow="false" pos="0 0 80" dir="-0.4 0.3 -0.87"
      diffuse="0.6 0.6 0.58" specular="0.1 0.1 0.1"/>
    <geom name="ground" type="plane" size="{numbers(shown_m, shown_m, shown_m)}" material="ground"
      contype="4" conaffinity="0"/>
    {_line(half_extent_m)}
  </worldbody>
</mujoco>
"""


def _line(half_extent_m: float) -> str:
    sides = ((1, 0), (-1, 0), (0, 1), (0, -1))
    half_length_m = half_extent_m + 0.15
    return "\n    ".join(
        f'<geom name="line_{number}" type="box" '
        f'pos="{numbers(side_x * half_extent_m, side_y * half_extent_m, 0.02)}" '
        f'size="{numbers(0.15 if side_x else half_length_m, 0.15 if side_y else half_length_m, 0.02)}" '
        'rgba="0.95 0.95 0.95 1" contype="0" conaffinity="0"/>'
        for number, (side_x, side_y) in enumerate(sides)
    )


def block_mjcf(block: Block, shade: int = 0) -> str:
    """MJCF of a box fixed to the ground; ``shade`` picks its colour."""
    half_height_m = block.height_m / 2.0
    return f"""
<mujoco model="block">
  <worldbody>
    <geom name="box" type="box" pos="{numbers(block.x_m, block.y_m, half_height_m)}"
      size="{numbers(block.half_x_m, block.half_y_m, half_height_m)}"
      rgba="{BLOCK_RGBAS[shade % len(BLOCK_RGBAS)]}" contype="{BLOCK_CONTYPE}"
      conaffinity="{BLOCK_CONAFFINITY}" gap="{NEAR_BLOCK_M}" friction="0.3 0.005 0.0001"/>
    <geom name="shadow" type="box" pos="{numbers(block.x_m - 0.25, block.y_m + 0.2, 0.02)}"
      size="{numbers(block.half_x_m + 0.35, block.half_y_m + 0.35, 0.01)}"
      rgba="{SHADOW_RGBA}" contype="0" conaffinity="0"/>
  </worldbody>
</mujoco>
"""


def ball_mjcf(x_m: float, y_m: float) -> str:
    """MJCF of the large orange ball; it is a mark, the car drives through it."""
    return f"""
<mujoco model="ball">
  <worldbody>
    <geom name="sphere" type="sphere" pos="{numbers(x_m, y_m, BALL_RADIUS_M)}"
      size="{numbers(BALL_RADIUS_M)}" rgba="{BALL_RGBA}" contype="0" conaffinity="0"/>
    <geom name="shadow" type="cylinder" pos="{numbers(x_m, y_m, 0.02)}"
      size="{numbers(1.1 * BALL_RADIUS_M, 0.01)}"
      rgba="{SHADOW_RGBA}" contype="0" conaffinity="0"/>
  </worldbody>
</mujoco>
"""


def scene_parts(world: WorldSpec, car: CarConfig) -> Iterator[tuple[str, str]]:
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
    for name, mjcf in scene_parts(world, car):
        frame = spec.worldbody.add_body(name=f"{name}/").add_frame()
        spec.attach(mujoco.MjSpec.from_string(mjcf), prefix=f"{name}/", frame=frame)
    return spec
