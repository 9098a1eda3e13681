"""The ground: a square with a line around it, a sky and one light that casts no shadow."""

from steerlab.sim.engine.car_state import USERDATA_SIZE
from steerlab.sim.engine.mjcf_text import numbers

PHYSICS_TIMESTEP_S = 0.01
GROUND_TEXTURE_M = 5.0  # side of one checker pair, large enough not to flicker at 64 x 64


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
