"""The car's dimensions and limits, shared by the physics, the planner and the wheel."""

from dataclasses import dataclass
from math import hypot, inf, tan

from steerlab.sim.errors import InvalidConfig

WHEEL_LIMIT = 2.5  # paper: "the position of the wheel ... is constrained to be between -2.5 to 2.5"


@dataclass(frozen=True, kw_only=True)
class CarConfig:
    """A mid-size car. A positive wheel turns left (counter-clockwise), as in the world frame."""

    wheelbase_m: float = 2.6
    track_m: float = 1.5
    length_m: float = 4.2
    width_m: float = 1.8
    mass_kg: float = 1200.0
    yaw_inertia_kgm2: float = 1800.0
    friction: float = 0.9  # mu of the tyres: they slide at mu * m * g
    cornering_stiffness_n: float = 60_000.0  # C of one axle, lateral force per slip angle
    full_lock_rad: float = 0.6  # road-wheel angle at wheel position WHEEL_LIMIT
    cruise_speed_mps: float = 5.0  # the constant throttle of the paper's task
    max_speed_mps: float = 10.0  # target speed at throttle 1
    max_brake_n: float = 9_000.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 < value < inf:
                raise InvalidConfig(f"CarConfig.{name} is {value}; it must be positive and finite.")
        if self.cruise_speed_mps > self.max_speed_mps:
            raise InvalidConfig(
                f"cruise_speed_mps {self.cruise_speed_mps} exceeds max_speed_mps "
                f"{self.max_speed_mps}; lower one or raise the other."
            )

    def road_wheel_rad(self, wheel: float) -> float:
        """Road-wheel angle for a wheel position in [-WHEEL_LIMIT, WHEEL_LIMIT]."""
        return wheel / WHEEL_LIMIT * self.full_lock_rad

    def wheel(self, road_wheel_rad: float) -> float:
        """Wheel position for a road-wheel angle, clipped at full lock."""
        scaled = road_wheel_rad / self.full_lock_rad * WHEEL_LIMIT
        return min(WHEEL_LIMIT, max(-WHEEL_LIMIT, scaled))

    @property
    def min_turn_radius_m(self) -> float:
        """Radius of the rear-axle centre at full lock, without tyre slip."""
        return self.wheelbase_m / tan(self.full_lock_rad)

    @property
    def disc_offsets_m(self) -> tuple[float, float, float]:
        """Where along the car's axis the three discs sit that cover its footprint."""
        return (-self.length_m / 3.0, 0.0, self.length_m / 3.0)

    @property
    def disc_radius_m(self) -> float:
        """Radius of each of the three discs that cover the footprint."""
        return hypot(self.length_m / 6.0, self.width_m / 2.0)
