"""Everything that touches MuJoCo. The OpenGL back end is chosen here, before MuJoCo's import."""

from steerlab.sim.engine.gl import choose_gl

choose_gl()
