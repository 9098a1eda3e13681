"""``PlannerConfig``: every setting of the ground truth in one place."""

from dataclasses import dataclass

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world_generator import PLANNING_MARGIN_M


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """How paths are planned and followed; the benchmarks were run with the defaults.

    Attributes:
        plan_radius_m: turning radius of planned paths; about 1.3 times the car's least radius or
            more, so that the wheel keeps something in reserve.
        nodes: samples of the point tree.
        dubins_nodes: samples of the tree over poses.
        goal_headings: directions from which the ball may be approached.
        grid_m: cell of the distance grid.
        margin_m: kept between the car's discs and a block by the trees.
        label_margin_share: share of ``margin_m`` a label's path keeps; below 1, so that a car a
            little inside the margin is not sent on another route.
        path_step_m: distance between the points of a path.
        hysteresis_m: a label keeps its route unless another is shorter by this much.
        verify_s: a label's path is driven in simulation for this long before it is believed.
        stanley_gain: k, per second, of the cross-track error.
        stanley_softening_mps: k_s, so that the wheel stays calm at low speed.
        steer_rate_radps: how fast the road wheels turn.
        steer_lag_s: time constant of the steering.
    """

    plan_radius_m: float = 6.5
    nodes: int = 10_000
    dubins_nodes: int = 3_000
    goal_headings: int = 36
    grid_m: float = 0.25
    margin_m: float = PLANNING_MARGIN_M
    label_margin_share: float = 0.5
    path_step_m: float = 0.5
    hysteresis_m: float = 3.0
    verify_s: float = 4.0
    stanley_gain: float = 1.0
    stanley_softening_mps: float = 1.0
    steer_rate_radps: float = 3.0
    steer_lag_s: float = 0.1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            floor = 0.0 if name not in ("nodes", "dubins_nodes", "goal_headings") else 1
            may_be_floor = name in ("hysteresis_m", "label_margin_share") or floor == 1
            if not (value > floor or (may_be_floor and value == floor)):
                raise InvalidConfig(
                    f"PlannerConfig.{name} is {value}; it must be "
                    f"{'at least' if may_be_floor else 'more than'} {floor:g}."
                )
        if self.label_margin_share > 1.0:
            raise InvalidConfig(
                f"label_margin_share is {self.label_margin_share}; it is a share, at most 1."
            )
        if self.path_step_m > 1.0:
            raise InvalidConfig(f"path_step_m is {self.path_step_m} m; a turn needs at most 1 m.")

    def check_car(self, car: CarConfig) -> None:
        """Refuse a radius the car cannot drive.

        Raises:
            InvalidConfig: ``plan_radius_m`` is below 1.1 times the car's least turning radius.
        """
        if self.plan_radius_m < 1.1 * car.min_turn_radius_m:
            raise InvalidConfig(
                f"plan_radius_m {self.plan_radius_m} leaves no reserve over the car's least "
                f"turning radius of {car.min_turn_radius_m:.2f} m; give at least 1.1 times that."
            )
