"""The car: a planar chassis pushed by four tyre actuators whose law runs inside MuJoCo.

Against a dynamic bicycle its turning radius errs by about 2 %; it cannot flip, drives exactly
straight hands-off and costs 5 µs a physics step, where a contact car costs 14-33 µs.
"""

from math import pi

from dm_control import composer, mjcf
from dm_control.composer.observation import observable

from steerlab.sim.engine.car_state import acceleration, pose, velocity
from steerlab.sim.engine.props import SHADOW_RGBA
from steerlab.sim.vehicle import CarConfig

GRAVITY_MPS2 = 9.81
IMU_HEIGHT_M = 0.4
AXLE_HEIGHT_M = 0.33
KNUCKLE_RANGE_RAD = 0.78  # the inner wheel turns further than the mean (Ackermann)
TYRE_CTRL_MAX = 1e6
ACTUATORS = ("steer_fl", "steer_fr", "drive", "brake", "tyre_fl", "tyre_fr", "tyre_rl", "tyre_rr")
_PAINT = (0.80, 0.12, 0.14, 1.0)
_GLASS = (0.15, 0.20, 0.25, 1.0)
_RUBBER = (0.08, 0.08, 0.08, 1.0)
_NO_CONTACT = {"contype": 0, "conaffinity": 0}
CAR_GROUP = 1  # of geoms; the front camera sees none of the car and skips drawing it


class Car(composer.Entity):
    """The car; attach it at the arena's origin, its pose lives in the joints x, y and yaw."""

    def _build(self, config: CarConfig | None = None, name: str = "car") -> None:
        self._config = config or CarConfig()
        self._mjcf = mjcf.RootElement(model=name)
        self._mjcf.compiler.angle = "radian"
        self._chassis = self._mjcf.worldbody.add("body", name="chassis")
        self._add_chassis()
        self._add_wheels()
        self._add_actuators()
        self._add_cameras()

    def _build_observables(self) -> "CarObservables":
        return CarObservables(self)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The car's own MJCF."""
        return self._mjcf

    @property
    def chassis(self) -> mjcf.Element:
        """The body that carries everything."""
        return self._chassis

    def _add_chassis(self) -> None:
        config, body = self._config, self._chassis
        body.add(
            "inertial",
            pos=(0, 0, IMU_HEIGHT_M),
            mass=config.mass_kg,
            diaginertia=(400, 1600, config.yaw_inertia_kgm2),
        )
        body.add("joint", name="x", type="slide", axis=(1, 0, 0))
        body.add("joint", name="y", type="slide", axis=(0, 1, 0))
        body.add("joint", name="yaw", type="hinge", axis=(0, 0, 1))
        body.add("site", name="imu", pos=(0, 0, IMU_HEIGHT_M))
        length, width = config.length_m / 2, config.width_m / 2
        body.add(
            "geom",
            name="chassis",
            type="box",
            size=(length, width, 0.28),
            pos=(0, 0, 0.6),
            rgba=_PAINT,
            contype=2,
            conaffinity=1,
            friction=(0.3, 0.005, 0.0001),
            group=CAR_GROUP,
        )
        for part, size, pos, rgba in (
            ("cabin", (0.42 * length, 0.88 * width, 0.24), (-0.25, 0, 1.1), _GLASS),
            ("roof", (0.36 * length, 0.84 * width, 0.03), (-0.25, 0, 1.36), _PAINT),
            ("shadow", (1.04 * length, 1.1 * width, 0.01), (-0.05, 0, 0.03), SHADOW_RGBA),
        ):
            body.add(
                "geom",
                name=part,
                type="box",
                size=size,
                pos=pos,
                rgba=rgba,
                group=CAR_GROUP,
                **_NO_CONTACT,
            )

    def _add_wheels(self) -> None:
        half_base, half_track = self._config.wheelbase_m / 2, self._config.track_m / 2
        for name, x_m, y_m in (
            ("fl", half_base, half_track),
            ("fr", half_base, -half_track),
            ("rl", -half_base, half_track),
            ("rr", -half_base, -half_track),
        ):
            holder, pos = self._chassis, (x_m, y_m, AXLE_HEIGHT_M)
            if name in ("fl", "fr"):
                holder = self._chassis.add("body", name=f"knuckle_{name}", pos=pos)
                holder.add("inertial", pos=(0, 0, 0), mass=0.01, diaginertia=(0.01, 0.01, 0.01))
                holder.add(
                    "joint",
                    name=f"steer_{name}",
                    axis=(0, 0, 1),
                    range=(-KNUCKLE_RANGE_RAD, KNUCKLE_RANGE_RAD),
                    limited=True,
                    armature=1,
                    damping=1,
                )
                pos = (0, 0, 0)
            holder.add("site", name=name, pos=pos)
            holder.add(
                "geom",
                name=f"wheel_{name}",
                type="cylinder",
                pos=(pos[0], pos[1] * 1.12, pos[2]),
                size=(AXLE_HEIGHT_M, 0.13),
                euler=(pi / 2, 0, 0),
                rgba=_RUBBER,
                group=CAR_GROUP,
                **_NO_CONTACT,
            )

    def _add_actuators(self) -> None:
        config, actuator, site = self._config, self._mjcf.actuator, self._mjcf.find
        tyre_limit_n = config.friction * config.mass_kg * GRAVITY_MPS2 / 4.0
        for name in ("fl", "fr"):
            actuator.add(
                "position",
                name=f"steer_{name}",
                joint=f"steer_{name}",
                kp=400,
                kv=40,
                ctrllimited=True,
                ctrlrange=(-KNUCKLE_RANGE_RAD, KNUCKLE_RANGE_RAD),
            )
        along, across = (1, 0, 0, 0, 0, 0), (0, 1, 0, 0, 0, 0)
        actuator.add(  # force = 6000 * (target speed - speed), within what the engine can do
            "general",
            name="drive",
            site=site("site", "imu"),
            gear=along,
            gainprm=(6000,),
            biastype="affine",
            biasprm=(0, 0, -6000),
            forcelimited=True,
            forcerange=(-6000, 4000),
        )
        viscous = {  # force = -ctrl * speed of the site along the gear, clamped
            "gaintype": "affine",
            "gainprm": (0, 0, -1),
            "biastype": "none",
            "ctrllimited": True,
            "ctrlrange": (0, TYRE_CTRL_MAX),
            "forcelimited": True,
        }
        brake_range = (-config.max_brake_n, config.max_brake_n)
        imu = site("site", "imu")
        actuator.add(
            "general", name="brake", site=imu, gear=along, forcerange=brake_range, **viscous
        )
        for name in ("fl", "fr", "rl", "rr"):
            actuator.add(
                "general",
                name=f"tyre_{name}",
                site=site("site", name),
                gear=across,
                forcerange=(-tyre_limit_n, tyre_limit_n),
                **viscous,
            )

    def _add_cameras(self) -> None:
        ahead_x_up = {"mode": "fixed", "xyaxes": (0, -1, 0, 0.12, 0, 1)}
        front_m = self._config.length_m / 2
        self._chassis.add("camera", name="front", pos=(front_m, 0, 1.1), fovy=60, **ahead_x_up)
        self._chassis.add(
            "camera",
            name="chase",
            pos=(-8.5, 0, 4.2),
            mode="fixed",
            xyaxes=(0, -1, 0, 0.3, 0, 1),
            fovy=55,
        )


class CarObservables(composer.Observables):
    """The paper's state without the image: position, heading, body velocity and acceleration."""

    @composer.observable
    def pose(self) -> observable.Generic:
        """(3,) x_m, y_m, heading_rad."""
        return observable.Generic(lambda physics: pose(physics.data.ptr))

    @composer.observable
    def velocity(self) -> observable.Generic:
        """(3,) forward and leftward speed in m/s, yaw rate in rad/s."""
        return observable.Generic(lambda physics: velocity(physics.data.ptr))

    @composer.observable
    def acceleration(self) -> observable.Generic:
        """(2,) forward and leftward acceleration in m/s²."""
        return observable.Generic(lambda physics: acceleration(physics.data.ptr))
