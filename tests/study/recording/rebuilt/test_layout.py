"""Where a wheel would take the car, against circles and straight lines."""

from math import isnan, nan, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.study.recording import layout

CAR = CarConfig()


@given(wheel=st.floats(-WHEEL_LIMIT, WHEEL_LIMIT))
def test_a_way_lies_on_the_circle_of_its_wheel(wheel):
    ((points, _),) = layout.ways([wheel, nan, nan], CAR)
    np.testing.assert_allclose(points[0, :2], 0.0, atol=1e-12)
    bend = tan(CAR.road_wheel_rad(wheel)) / CAR.wheelbase_m
    turned_rad = bend * np.linspace(0.0, layout.WAY_M, len(points))
    half_base_m = CAR.wheelbase_m / 2.0
    rear = points[:, :2] - half_base_m * (np.column_stack([np.cos(turned_rad), np.sin(turned_rad)]))
    to_centre = rear + np.array((half_base_m, 0.0))  # from the rear axle, where it began
    # every point of a circle of curvature k through the origin along x: k (x² + y²) = 2 y
    np.testing.assert_allclose(bend * (to_centre**2).sum(axis=1), 2.0 * to_centre[:, 1], atol=1e-6)
    length_m = np.hypot(*np.diff(to_centre, axis=0).T).sum()
    assert length_m == pytest.approx(layout.WAY_M, rel=5e-3)


def test_left_is_up_and_unknown_wheels_have_no_way():
    left, right = layout.ways([1.0, -1.0, nan], CAR)
    assert left[0][-1, 1] > 1.0
    np.testing.assert_allclose(right[0][:, 1], -left[0][:, 1])
    assert (left[1], right[1]) == (layout.TEACHER_RGB, layout.ROBOT_RGB)
    ((straight, _),) = layout.ways([nan, 0.0, nan], CAR)
    np.testing.assert_allclose(straight[-1, :2], (layout.WAY_M, 0.0), atol=1e-12)


def test_missing_values_leave_gaps(study):
    from steerlab.study.recording.rebuild import open_study

    with open_study(study) as store:
        data = store.attempt_data(store.attempts()[0])
    gaps = [step.step for step in data.steps if isnan(layout.wheels(step)[0])]
    assert gaps == [5, 6, 7]
    assert layout.timing_ms(data.times[1]) == pytest.approx((0.04, 2.0))
    assert isnan(layout.timing_ms(data.times[0])[1])
