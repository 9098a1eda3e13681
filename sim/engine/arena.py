"""The ground: a square with a line around it, a sky and one light that casts no shadow."""

from typing import Any

from dm_control import composer

from steerlab.sim.engine.car_state import USERDATA_SIZE

PHYSICS_TIMESTEP_S = 0.01
GROUND_TEXTURE_M = 5.0  # side of one checker pair, large enough not to flicker at 64 x 64


class Ground(composer.Arena):
    """Ground plane of ``2 * half_extent_m`` a side, plus some more to look at beyond the line."""

    def _build(self, half_extent_m: float, name: str = "ground") -> None:
        super()._build(name=name)
        root: Any = self.mjcf_model
        root.compiler.angle = "radian"
        option = root.option
        option.timestep = PHYSICS_TIMESTEP_S
        option.integrator = "implicitfast"
        option.solver = "Newton"
        option.cone = "pyramidal"
        option.iterations = 20
        option.ls_iterations = 10
        root.size.nuserdata = USERDATA_SIZE
        root.statistic.center = (0, 0, 0)
        root.statistic.extent = 50.0
        quality = root.visual.quality
        quality.shadowsize = 0
        quality.numslices, quality.numstacks, quality.numquads = 20, 12, 1
        clip = root.visual.map
        clip.znear, clip.zfar = 0.005, 10.0  # times the extent: 0.25 m to 500 m
        root.visual.headlight.set_attributes(
            ambient=(0.45, 0.45, 0.45), diffuse=(0.2, 0.2, 0.2), specular=(0, 0, 0)
        )
        root.worldbody.add(
            "light",
            name="sun",
            pos=(0, 0, 80),
            dir=(-0.4, 0.3, -0.87),
            directional=True,
            castshadow=False,
            diffuse=(0.6, 0.6, 0.58),
            specular=(0.1, 0.1, 0.1),
        )
        self._add_sky_and_ground(half_extent_m)
        self._add_line(half_extent_m)

    def _add_sky_and_ground(self, half_extent_m: float) -> None:
        root: Any = self.mjcf_model
        root.asset.add(
            "texture",
            name="sky",
            type="skybox",
            builtin="gradient",
            rgb1=(0.45, 0.62, 0.80),
            rgb2=(0.86, 0.91, 0.95),
            width=64,
            height=64,
        )
        texture = root.asset.add(
            "texture",
            name="ground",
            type="2d",
            builtin="checker",
            rgb1=(0.56, 0.58, 0.55),
            rgb2=(0.50, 0.52, 0.50),
            width=128,
            height=128,
        )
        shown_m = 4.0 * half_extent_m
        material = root.asset.add(
            "material",
            name="ground",
            texture=texture,
            texrepeat=(2 * shown_m / GROUND_TEXTURE_M,) * 2,
            reflectance=0,
        )
        # The third size is the spacing of the drawn grid: equal to the extent it costs 3 ms less.
        root.worldbody.add(
            "geom",
            name="ground",
            type="plane",
            size=(shown_m, shown_m, shown_m),
            material=material,
            contype=4,
            conaffinity=0,
        )

    def _add_line(self, half_extent_m: float) -> None:
        root: Any = self.mjcf_model
        sides = ((1, 0), (-1, 0), (0, 1), (0, -1))
        for number, (side_x, side_y) in enumerate(sides):
            root.worldbody.add(
                "geom",
                name=f"line_{number}",
                type="box",
                pos=(side_x * half_extent_m, side_y * half_extent_m, 0.02),
                size=(
                    0.15 if side_x else half_extent_m + 0.15,
                    0.15 if side_y else half_extent_m + 0.15,
                    0.02,
                ),
                rgba=(0.95, 0.95, 0.95, 1),
                contype=0,
                conaffinity=0,
            )
