"""What stands on the ground: blocks to avoid and the ball to reach."""

from steerlab.sim.engine.mjcf_text import numbers
from steerlab.sim.world import BALL_RADIUS_M, Block

# A contact is listed when a block is this near, and pushes only when it touches: so the referee
# knows when to look at every physics step. More than the car moves in a control step.
NEAR_BLOCK_M = 1.0
BLOCK_CONTYPE, BLOCK_CONAFFINITY = 1, 2  # meets the chassis (2, 1) only
# A real shadow pass costs 30 ms a frame, translucency 0.2 ms; a dark box on plain ground neither.
SHADOW_RGBA = "0.22 0.23 0.22 1"
BALL_RGBA = "1 0.45 0.05 1"
BLOCK_RGBAS = ("0.27 0.36 0.52 1", "0.36 0.30 0.47 1", "0.24 0.44 0.46 1", "0.45 0.36 0.33 1")


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
