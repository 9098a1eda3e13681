import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.ground_truth import Planner, PlannerConfig
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import WorldSpec


@pytest.mark.parametrize(
    "wrong",
    [
        {"plan_radius_m": 0.0},
        {"nodes": 0},
        {"grid_m": -1.0},
        {"label_margin_share": 1.5},
        {"path_step_m": 2.0},
        {"hysteresis_m": -0.1},
        {"verify_s": float("nan")},
    ],
)
def test_refuses_and_names_the_setting(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfig, match=next(iter(wrong))):
        PlannerConfig(**wrong)


def test_hysteresis_may_be_switched_off() -> None:
    assert PlannerConfig(hysteresis_m=0.0).hysteresis_m == 0.0


def test_refuses_a_radius_the_car_cannot_turn(random_world: WorldSpec) -> None:
    with pytest.raises(InvalidConfig, match=r"least turning radius of 3\.80 m"):
        Planner(random_world, seed=0, config=PlannerConfig(plan_radius_m=4.0))
    bus = CarConfig(wheelbase_m=6.0, length_m=9.0)
    with pytest.raises(InvalidConfig, match="least turning radius"):
        Planner(random_world, seed=0, car=bus)
