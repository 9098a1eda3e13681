"""Scenery is for the eyes of people: it changes no physics, no policy's picture and gives nothing away."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from steerlab.sim.camera_config import viewpoints
from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving
from steerlab.sim.engine.scene import compose
from steerlab.sim.engine.scenery import add_scenery, scenery_rng
from steerlab.sim.engine.world_view import WorldView
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import Block

STEPS = ("qpos", "qvel", "userdata")


def _models(world):
    plain, decorated = compose(world, CarConfig()), compose(world, CarConfig())
    add_scenery(decorated, world, CarConfig())
    return plain.compile(), decorated.compile()


def test_even_a_scene_with_scenery_moves_bit_for_bit_as_one_without(wall_world):
    """It is never simulated; if it were, nothing in it would be felt, a block least of all."""
    states = []
    for model in _models(wall_world):
        data = mujoco.MjData(model)
        rng = np.random.default_rng(0)
        data.qvel[0] = 8.0
        for _ in range(300):  # into the wall
            data.ctrl[:] = (rng.uniform(-0.3, 0.3),) * 2 + (8.0, 0.0) + (8_000.0,) * 4
            mujoco.mj_step(model, data, 5)
        assert data.qpos[0] < 14.0
        states.append(np.concatenate([np.array(getattr(data, name)) for name in STEPS]))
    np.testing.assert_array_equal(*states)


def test_nothing_of_it_touches_or_weighs_anything(blocky_world):
    plain, decorated = _models(blocky_world)
    names = {plain.geom(number).name for number in range(plain.ngeom)}
    added = [
        decorated.geom(n) for n in range(decorated.ngeom) if decorated.geom(n).name not in names
    ]
    assert len(added) > 30
    for geom in added:
        assert (geom.contype[0], geom.conaffinity[0]) == (0, 0)
    for name in names:
        for field in ("contype", "conaffinity", "friction", "gap", "pos"):
            np.testing.assert_array_equal(
                getattr(plain.geom(name), field), getattr(decorated.geom(name), field)
            )
    assert plain.nq == decorated.nq
    np.testing.assert_array_equal(
        plain.body("car/chassis").mass, decorated.body("car/chassis").mass
    )


def test_the_simulated_scene_has_none_of_it(blocky_world):
    with Driving(blocky_world) as driving:
        geoms = {
            driving.model.geom(number).name.split("/")[0] for number in range(driving.model.ngeom)
        }
        assert driving.model.nmesh == 0
        assert driving.model.ntex == 2  # sky and checkered ground
    assert geoms <= {"ground", "car", "ball", *(f"line_{n}" for n in range(4))} | {
        f"block_{n}" for n in range(len(blocky_world.blocks))
    }


@pytest.mark.render
def test_a_policy_sees_what_it_always_saw(blocky_world):
    """The checkered ground's two greys, plain blocks and no hood: the look it was trained on."""
    with (
        Driving(blocky_world) as driving,
        Camera(driving.model, driving.data) as policy,
        WorldView(blocky_world) as person,
        WorldView(blocky_world, scenery=False) as plain,
    ):
        seen = policy.frame().copy()
        np.testing.assert_array_equal(seen, plain.frame(driving.state.pose))
        assert (seen != person.frame(driving.state.pose)).any()
        ground = seen[-4:].reshape(-1, 3).astype(int)
        assert np.ptp(ground, axis=1).max() < 12  # grey from edge to edge
        red = (seen[..., 0].astype(int) - seen[..., 1]) > 60
        assert not red[-16:].any()


@pytest.mark.render
def test_a_driver_sees_the_hood_and_a_bumper_does_not(open_world):
    hoods = []
    for view in ("driver", "front"):
        config = CameraConfig(width=160, height=90, view=view)
        with WorldView(open_world, config) as seen:
            frame = seen.frame(open_world.start).astype(int)
        hoods.append(((frame[..., 0] - frame[..., 1]) > 60)[-8:].mean())
    assert hoods[0] > 0.5
    assert hoods[1] == 0.0


def test_landmarks_do_not_know_where_the_ball_or_the_start_is(wall_world):
    moved = replace(wall_world, ball_xy_m=(-30.0, 20.0), start=Pose2D(5.0, -30.0, 1.0))
    scenes = [_models(world)[1] for world in (wall_world, moved)]
    for number in range(scenes[0].ngeom):
        one, other = scenes[0].geom(number), scenes[1].geom(number)
        assert one.name == other.name
        if one.name.split("/")[0] in ("ball", "pole", "flag"):
            continue
        np.testing.assert_array_equal(one.pos, other.pos)
        np.testing.assert_array_equal(one.rgba, other.rgba)
    np.testing.assert_array_equal(scenes[0].tex_data, scenes[1].tex_data)
    np.testing.assert_array_equal(scenes[0].mesh_vert, scenes[1].mesh_vert)


def test_each_ground_has_scenery_of_its_own_and_always_the_same(wall_world):
    other = replace(wall_world, blocks=(Block(15.0, 0.0, 1.0, 9.0),))
    drawn = [scenery_rng(world).random(4).tolist() for world in (wall_world, wall_world, other)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_landmarks_stand_beyond_the_line(blocky_world):
    model = _models(blocky_world)[1]
    for number in range(model.ngeom):
        geom = model.geom(number)
        if geom.name.startswith("landmark"):
            body = model.body(geom.bodyid[0]).pos
            assert max(abs(body[:2])) > blocky_world.half_extent_m + 15.0
    trees = model.mesh_vert[model.mesh_vertadr[model.mesh("trees_0").id] :][:100]
    assert len(trees)


@pytest.mark.render
@pytest.mark.parametrize("view", ["driver", "front", "chase"])
def test_a_viewpoint_says_where_the_camera_sees_a_point(open_world, view):
    """The ball's picture has its middle where the ball's middle is said to be."""
    size, pose = (320, 180), Pose2D(2.0, -3.0, 0.15)
    with WorldView(
        open_world, CameraConfig(width=320, height=180, view=view), scenery=False
    ) as seen:
        frame = seen.frame(pose).astype(int)
    orange = (frame[..., 0] > 130) & (frame[..., 2] < 60) & (frame[..., 1] > 40)
    rows, columns = np.nonzero(orange & (np.arange(180)[:, None] < 140))
    at = viewpoints(CarConfig())[view].seen(pose, (*open_world.ball_xy_m, 2.0), size)
    assert at.ahead_m == pytest.approx(28.0, abs=9.0)
    assert columns.mean() == pytest.approx(at.x_px - 0.5, abs=1.0)
    assert (rows.min() + rows.max()) / 2 == pytest.approx(at.y_px - 0.5, abs=1.5)


def test_what_is_behind_is_not_ahead():
    for viewpoint in viewpoints(CarConfig()).values():
        left = viewpoint.seen(Pose2D(0.0, 0.0, 0.0), (-30.0, 4.0, 0.0), (320, 180))
        assert left.ahead_m < 0.0
        assert left.x_px < 160
