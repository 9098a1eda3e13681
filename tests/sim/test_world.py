import json
from math import hypot, inf, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.engine.driving import DrivingConfig
from steerlab.sim.errors import InvalidConfig, InvalidWorld
from steerlab.sim.geometry import Pose2D, bearing_rad, wrap_angle
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import Block, WorldSpec
from steerlab.sim.world_generator import WorldConfig, generate_world

ANGLES = st.floats(-50, 50)
METRES = st.floats(-40, 40)


@given(ANGLES)
def test_wrapping_keeps_the_direction(angle):
    wrapped = wrap_angle(angle)
    assert -pi <= wrapped < pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-9)


@given(METRES, METRES, ANGLES, st.floats(0.1, 30))
def test_a_point_ahead_has_bearing_zero(x_m, y_m, heading_rad, distance_m):
    pose = Pose2D(x_m, y_m, heading_rad)
    ahead = pose.ahead(distance_m)
    assert hypot(ahead.x_m - x_m, ahead.y_m - y_m) == pytest.approx(distance_m)
    assert abs(bearing_rad(pose, (ahead.x_m, ahead.y_m))) < 1e-6


def test_left_is_positive():
    assert bearing_rad(Pose2D(0, 0, 0), (0.0, 5.0)) == pytest.approx(pi / 2)


@pytest.mark.parametrize("value", [nan, inf])
def test_a_pose_is_finite(value):
    with pytest.raises(InvalidConfig, match="finite"):
        Pose2D(value, 0.0, 0.0)


@given(st.floats(-4, 4))
def test_wheel_and_road_wheel_agree(wheel):
    car = CarConfig()
    assert car.wheel(car.road_wheel_rad(wheel)) == pytest.approx(
        np.clip(wheel, -WHEEL_LIMIT, WHEEL_LIMIT)
    )


def test_a_car_has_positive_sizes():
    with pytest.raises(InvalidConfig, match="wheelbase_m is 0"):
        CarConfig(wheelbase_m=0.0)
    with pytest.raises(InvalidConfig, match="cruise_speed_mps"):
        CarConfig(cruise_speed_mps=20.0)


def test_the_discs_cover_the_footprint():
    car = CarConfig()
    x_m, y_m = np.meshgrid(
        np.linspace(-car.length_m / 2, car.length_m / 2, 85),
        np.linspace(-car.width_m / 2, car.width_m / 2, 37),
    )
    nearest_m = np.min([np.hypot(x_m - o, y_m) for o in car.disc_offsets_m], axis=0)
    assert nearest_m.max() <= car.disc_radius_m + 1e-9


@given(st.integers(0, 2**32 - 1))
def test_generated_worlds_keep_the_rules(seed):
    world = generate_world("w", np.random.default_rng(seed))
    config, car = WorldConfig(), CarConfig()
    gap_m = config.min_gap_m(car)
    for number, block in enumerate(world.blocks):
        assert block.distance_m(world.start.x_m, world.start.y_m) > config.start_clearance_m
        for other in world.blocks[:number]:
            assert block.gap_m(other) == 0.0 or block.gap_m(other) >= gap_m
    ball_x_m, ball_y_m = world.ball_xy_m
    assert hypot(ball_x_m - world.start.x_m, ball_y_m - world.start.y_m) >= 45.0


def test_the_same_seed_gives_the_same_world_and_json_keeps_it():
    worlds = [generate_world("w", np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert worlds[0] == worlds[1] != worlds[2]
    assert WorldSpec.from_dict(json.loads(json.dumps(worlds[0].to_dict()))) == worlds[0]


def test_a_crowded_world_is_refused():
    crowded = WorldConfig(blocks=(400, 400))
    with pytest.raises(InvalidWorld, match="fewer or smaller"):
        generate_world("crowded", np.random.default_rng(0), crowded)


def test_worlds_refuse_what_cannot_be():
    block = Block(10.0, 0.0, 2.0, 2.0)
    start = Pose2D(0, 0, 0)
    with pytest.raises(InvalidWorld, match=r"ball .* inside"):
        WorldSpec(name="w", ball_xy_m=(13.0, 0.0), start=start, blocks=(block,))
    with pytest.raises(InvalidWorld, match=r"start .* inside"):
        WorldSpec(name="w", ball_xy_m=(30.0, 0.0), start=Pose2D(10, 0, 0), blocks=(block,))
    with pytest.raises(InvalidWorld, match="outside the ground"):
        WorldSpec(name="w", ball_xy_m=(60.0, 0.0), start=start)
    with pytest.raises(InvalidWorld, match="not positive"):
        Block(0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("spoil", [lambda d: d.pop("start"), lambda d: d.update(colour="red")])
def test_a_damaged_world_is_refused(spoil):
    values = WorldSpec(name="w", ball_xy_m=(30.0, 0.0), start=Pose2D(0, 0, 0)).to_dict()
    spoil(values)
    with pytest.raises(InvalidWorld, match="Not a world"):
        WorldSpec.from_dict(values)


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_what_is_not_finite_is_in_no_world_and_no_car(value):
    for name in ("x_m", "y_m", "half_x_m", "half_y_m", "height_m"):
        sizes = {"x_m": 5.0, "y_m": 5.0, "half_x_m": 1.0, "half_y_m": 1.0, "height_m": 1.0}
        with pytest.raises(InvalidWorld, match="not"):
            Block(**(sizes | {name: value}))
    good = {"name": "w", "ball_xy_m": (9.0, 0.0), "start": Pose2D(0.0, 0.0, 0.0)}
    for bad in ({"half_extent_m": value}, {"ball_xy_m": (value, 0.0)}, {"ball_xy_m": (0.0, value)}):
        with pytest.raises(InvalidWorld, match="finite"):
            WorldSpec(**(good | bad))
    for name in vars(CarConfig()):
        with pytest.raises(InvalidConfig, match=f"{name} is"):
            CarConfig(**{name: value})
    for name, usual in vars(WorldConfig()).items():
        with pytest.raises(InvalidConfig):
            WorldConfig(**{name: (value, value) if isinstance(usual, tuple) else value})
    for name in ("control_hz", "time_limit_s", "start_jitter_m", "start_jitter_rad"):
        with pytest.raises(InvalidConfig, match=f"{name} is"):
            DrivingConfig(**{name: value})
