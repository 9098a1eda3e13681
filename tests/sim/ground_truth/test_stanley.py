from math import atan, cos, hypot, pi, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.geometry import Pose2D, wrap_angle
from steerlab.sim.ground_truth import OracleDriver, Path, PlannerConfig
from steerlab.sim.ground_truth.stanley import project, stanley_rad, steering_of
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig

CAR, CONFIG = CarConfig(), PlannerConfig()
STEERING = steering_of(CAR, CONFIG)
ALONG_X = np.stack((np.arange(0.0, 60.5, 0.5), np.zeros(121)), axis=-1)


def _turned(points: FloatArray, angle: float) -> FloatArray:
    c, s = cos(angle), sin(angle)
    return points @ np.array(((c, s), (-s, c)))


@settings(deadline=None)  # the first example may have to compile
@given(
    off=st.floats(-3.0, 3.0),
    error=st.floats(-1.0, 1.0),
    speed=st.floats(0.0, 10.0),
    angle=st.floats(-pi, pi),
)
def test_closed_form_on_a_straight_path(
    off: float, error: float, speed: float, angle: float
) -> None:
    """delta = heading error + atan(k e / (k_s + v)), in any direction."""
    front = _turned(np.array([[4.0, -off]]), angle)[0]  # the path lies ``off`` to its left
    heading = angle - error
    rear = front - CAR.wheelbase_m * np.array((cos(heading), sin(heading)))
    delta, _ = stanley_rad(
        _turned(ALONG_X, angle), np.full(121, angle), 0, *rear, heading, speed, STEERING
    )
    wanted = error + atan(CONFIG.stanley_gain * off / (CONFIG.stanley_softening_mps + speed))
    assert np.isclose(delta, np.clip(wanted, -CAR.full_lock_rad, CAR.full_lock_rad), atol=1e-9)


def test_steady_turn_needs_the_angle_of_the_bicycle() -> None:
    """With the front axle on a circle, the heading error alone is the bicycle's steering angle."""
    front_radius_m = 12.0
    angles = np.arange(0.0, 3.0, 0.01)
    points = front_radius_m * np.stack((np.sin(angles), 1.0 - np.cos(angles)), axis=-1)
    delta = np.arcsin(CAR.wheelbase_m / front_radius_m)  # the rear follows a smaller circle
    at = 1.0  # radian along the path
    heading = at - delta
    front = front_radius_m * np.array((sin(at), 1.0 - cos(at)))
    rear = front - CAR.wheelbase_m * np.array((cos(heading), sin(heading)))
    found, _ = stanley_rad(points, angles, 80, *rear, heading, 5.0, STEERING)
    assert np.isclose(found, delta, atol=1e-4)
    rear_radius_m = hypot(rear[0], rear[1] - front_radius_m)
    assert np.isclose(tan(delta), CAR.wheelbase_m / rear_radius_m)


def test_heading_is_interpolated_and_the_ends_prolonged() -> None:
    points = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    heading = np.array([0.0, 0.4, 2 * pi])  # the last one is 0 again
    segment, error_m, bearing = project(points, heading, 0, 2.5, -1.0)
    assert (segment, error_m) == (0, 1.0)
    assert np.isclose(bearing, 0.1)
    assert np.isclose(project(points, heading, 0, 15.0, 0.0)[2], 0.2)
    segment, error_m, _ = project(points, heading, 0, -5.0, 2.0)
    assert (segment, error_m) == (0, -2.0)
    segment, error_m, _ = project(points, heading, 1, 30.0, 2.0)
    assert (segment, error_m) == (1, -2.0)


def test_driver_never_looks_back_where_a_path_crosses_itself() -> None:
    angles = np.arange(0.0, 2 * pi, 0.05)
    loop = 8.0 * np.stack((np.sin(angles), 1.0 - np.cos(angles)), axis=-1)
    points = np.concatenate((ALONG_X[:21] - (10.0, 0.0), loop[1:], ALONG_X[1:41]))
    heading = np.concatenate((np.zeros(21), angles[1:], np.full(40, 2 * pi)))
    driver = OracleDriver(Path(points, heading), CAR, CONFIG)
    seen = []
    for (x_m, y_m), heading_rad in zip(points[:-2], heading[:-2], strict=True):
        rear = Pose2D(float(x_m), float(y_m), float(heading_rad))
        wheel = driver.wheel(rear.ahead(CAR.wheelbase_m / 2), 5.0)
        assert abs(wheel) <= WHEEL_LIMIT
        seen.append(driver.segment)
    assert seen == sorted(seen)
    assert seen[-1] >= len(points) - 8
    assert len(set(seen)) > 0.8 * len(seen)  # the loop was driven, not skipped


def test_positive_wheel_turns_towards_a_path_on_the_left() -> None:
    driver = OracleDriver(Path(ALONG_X, np.zeros(121)), CAR, CONFIG)
    assert driver.wheel(Pose2D(5.0, -1.0, 0.0), 5.0) > 0.2
    assert driver.wheel(Pose2D(6.0, 1.0, 0.0), 5.0) < -0.2
    assert driver.wheel(Pose2D(7.0, 0.0, wrap_angle(0.3)), 5.0) < -0.2


@pytest.mark.parametrize(
    ("points", "heading"),
    [
        (np.zeros((1, 2)), np.zeros(1)),
        (np.zeros((3, 3)), np.zeros(3)),
        (np.zeros((3, 2)), np.zeros(2)),
        (np.full((3, 2), np.nan), np.zeros(3)),
    ],
)
def test_a_path_of_the_wrong_shape_is_refused(points: FloatArray, heading: FloatArray) -> None:
    with pytest.raises(InvalidConfig, match=r"[Pp]ath"):
        Path(points, heading)


def test_a_path_knows_its_length() -> None:
    path = Path(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 10.0]]), np.zeros(3))
    np.testing.assert_allclose(path.arc_m, [0.0, 5.0, 11.0])
    assert path.length_m == 11.0
