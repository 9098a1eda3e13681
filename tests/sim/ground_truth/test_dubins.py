from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.geometry import wrap_angle
from steerlab.sim.ground_truth.dubins import (
    WORDS,
    dubins_length_m,
    dubins_pose,
    dubins_word,
    shortest_dubins,
)

RADIUS_M = 6.5
coordinate = st.floats(-40.0, 40.0)
angle = st.floats(-pi, pi)
pose = st.tuples(coordinate, coordinate, angle)
Pose = tuple[float, float, float]


@settings(deadline=None)  # the first example may have to compile
@given(a=pose, b=pose)
def test_ends_at_the_pose_it_was_asked_for(a: Pose, b: Pose) -> None:
    word, t, p, q = shortest_dubins(*a, *b, RADIUS_M)
    x, y, heading = dubins_pose(*a, word, t, p, q, RADIUS_M, (t + p + q) * RADIUS_M)
    assert np.hypot(x - b[0], y - b[1]) < 1e-6
    assert abs(wrap_angle(heading - b[2])) < 1e-6


@settings(deadline=None)  # the first example may have to compile
@given(a=pose, b=pose, word=st.integers(0, 5))
def test_each_word_that_exists_leads_there(a: Pose, b: Pose, word: int) -> None:
    dx, dy = (b[0] - a[0]) / RADIUS_M, (b[1] - a[1]) / RADIUS_M
    line, distance = np.arctan2(dy, dx), float(np.hypot(dx, dy))
    t, p, q = dubins_word(word, distance, a[2] - line, b[2] - line)
    if np.isfinite(t):
        x, y, heading = dubins_pose(*a, word, t, p, q, RADIUS_M, (t + p + q) * RADIUS_M)
        assert np.hypot(x - b[0], y - b[1]) < 1e-5, WORDS[word]
        assert abs(wrap_angle(heading - b[2])) < 1e-5


@settings(deadline=None)  # the first example may have to compile
@given(a=pose, b=pose)
def test_is_the_shortest_of_all_six(a: Pose, b: Pose) -> None:
    dx, dy = (b[0] - a[0]) / RADIUS_M, (b[1] - a[1]) / RADIUS_M
    line, distance = np.arctan2(dy, dx), float(np.hypot(dx, dy))
    every = [sum(dubins_word(w, distance, a[2] - line, b[2] - line)) for w in range(6)]
    assert np.isclose(dubins_length_m(a, b, RADIUS_M), min(every) * RADIUS_M)


@settings(deadline=None)  # the first example may have to compile
@given(a=pose, b=pose)
def test_mirror_image_and_reversal_are_as_long(a: Pose, b: Pose) -> None:
    length_m = dubins_length_m(a, b, RADIUS_M)
    mirrored = dubins_length_m((a[0], -a[1], -a[2]), (b[0], -b[1], -b[2]), RADIUS_M)
    backward = dubins_length_m((b[0], b[1], b[2] + pi), (a[0], a[1], a[2] + pi), RADIUS_M)
    # where left and right are equally long, rounding may turn a turn of 0 into one of 2 pi
    assert np.isclose(length_m, mirrored, atol=1e-5)
    assert np.isclose(length_m, backward, atol=1e-5)


@pytest.mark.parametrize(
    ("b", "length"),
    [
        ((10.0, 0.0, 0.0), 10.0),  # straight
        ((1.0, 1.0, pi / 2), pi / 2),  # a quarter to the left
        ((0.0, 2.0, pi), pi),  # half a circle
        ((0.0, 0.0, 0.0), 0.0),
        # two eighths about (0, -1) and (4, -5) with the line between these centres
        ((5.0, -5.0, -pi / 2), np.hypot(4.0, 4.0) + pi / 2),
        ((0.0, 0.0, pi), 7.0 * pi / 3.0),  # turn on the spot: RLR of 60, 300 and 60 degrees
    ],
)
def test_known_lengths(b: Pose, length: float) -> None:
    assert np.isclose(dubins_length_m((0.0, 0.0, 0.0), b, 1.0), length)


def test_steps_along_the_curve_are_as_long_as_asked() -> None:
    word, t, p, q = shortest_dubins(0.0, 0.0, 0.3, 12.0, -9.0, 2.0, RADIUS_M)
    along = np.arange(0.0, (t + p + q) * RADIUS_M, 0.05)
    poses = np.array([dubins_pose(0.0, 0.0, 0.3, word, t, p, q, RADIUS_M, s) for s in along])
    np.testing.assert_allclose(np.hypot(*np.diff(poses[:, :2], axis=0).T), 0.05, rtol=1e-4)
    assert np.abs(np.diff(poses[:, 2])).max() <= 0.05 / RADIUS_M + 1e-9
