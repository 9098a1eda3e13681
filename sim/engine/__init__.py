"""Everything that touches MuJoCo. What must precede its import happens here, in this order."""

from steerlab.sim.engine.gl import choose_gl, settle_triton

settle_triton()
choose_gl()
