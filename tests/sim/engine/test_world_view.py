import numpy as np
import pytest

from steerlab.sim.engine.camera import Camera, CameraConfig
from steerlab.sim.engine.driving import Driving
from steerlab.sim.engine.world_view import WorldView, ackermann_rad
from steerlab.sim.errors import NoRenderer
from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import CarConfig

SIZE = {"width": 160, "height": 90}


@pytest.mark.render
@pytest.mark.parametrize("wheel", [0.0, 1.3, -1.3])
@pytest.mark.parametrize("view", ["front", "chase"])
def test_a_frame_is_what_a_camera_on_the_drive_sees(blocky_world, view, wheel):
    """Held until the front wheels have settled, so that their angle is known exactly."""
    config = CameraConfig(**SIZE, view=view)
    with Driving(blocky_world) as driving:
        driving.reset(1)
        for _ in range(40):
            driving.step(wheel)
        recorded = driving.physics_state()
        driving.step(-wheel)
        driving.restore(recorded)
        with Camera(driving.model, driving.data, config) as camera:
            expected = camera.frame().copy()
        with WorldView(blocky_world, config, scenery=False) as view_of_world:
            frame = view_of_world.frame(driving.state.pose, CarConfig().road_wheel_rad(wheel))
            np.testing.assert_array_equal(frame, expected)


@pytest.mark.render
def test_the_pose_is_seen_and_forgotten(open_world):
    config = CameraConfig(**SIZE, view="chase")
    start = Pose2D(0.0, 0.0, 0.0)
    with WorldView(open_world, config) as view:
        assert view.size_px == (160, 90)
        first = view.frame(start).copy()
        assert (view.frame(Pose2D(3.0, 0.0, 0.0)) != first).any()
        assert (view.frame(Pose2D(0.0, 0.0, 0.2)) != first).any()
        out = np.empty_like(first)
        assert view.frame(Pose2D(0.0, 1.0, 0.0), 0.0, out) is out
        assert (out != first).any()
        np.testing.assert_array_equal(view.frame(start), first)


@pytest.mark.render
def test_the_front_wheels_turn(open_world):
    """The rear wheels hide them from the chase camera but for a pixel or two."""
    with WorldView(open_world, CameraConfig(**SIZE, view="chase")) as view:
        view.frame(open_world.start, 0.4)
        angles = [float(view._data.joint(f"car/steer_{side}").qpos[0]) for side in ("fl", "fr")]
        assert angles == pytest.approx(ackermann_rad(CarConfig(), 0.4))


@pytest.mark.render
def test_a_closed_view_says_so(open_world):
    view = WorldView(open_world, CameraConfig(**SIZE))
    view.close()
    view.close()
    with pytest.raises(NoRenderer, match="closed"):
        view.frame(Pose2D(0.0, 0.0, 0.0))


def test_the_inner_wheel_turns_further_and_both_axles_turn_about_one_centre():
    car = CarConfig()
    left, right = ackermann_rad(car, 0.4)
    assert left > 0.4 > right > 0.0
    centre_m = car.wheelbase_m / np.tan([left, right]) + np.array([1, -1]) * car.track_m / 2
    assert centre_m == pytest.approx(car.wheelbase_m / np.tan(0.4))
    assert ackermann_rad(car, -0.4) == pytest.approx((-right, -left))
    assert ackermann_rad(car, 0.0) == (0.0, 0.0)
