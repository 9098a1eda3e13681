"""Label placement."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from steerlab.analysis.figures.placement import clearest_spot, spread

numbers = st.floats(-100, 100)


@given(st.lists(numbers, max_size=8), st.floats(0.01, 10))
def test_spread_labels_keep_their_order_and_distance(wanted: list[float], gap: float):
    placed = spread(wanted, gap)
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    steps = np.diff([placed[i] for i in order])
    assert (steps >= gap - 1e-6).all()


@given(st.lists(numbers, min_size=1, max_size=8, unique=True))
def test_labels_with_room_stay_where_they_belong(wanted: list[float]):
    gaps = np.diff(sorted(wanted))
    gap = 0.99 * float(gaps.min()) if len(gaps) else 1.0
    np.testing.assert_allclose(spread(wanted, gap), wanted, atol=1e-9)


def test_touching_labels_centre_on_what_they_name():
    assert spread([1.0, 1.0, 1.0], 2.0) == [-1.0, 1.0, 3.0]


def test_the_clearest_spot_avoids_what_is_taken():
    candidates = np.array([(0.0, 0.0), (5.0, 0.0), (20.0, 0.0)])
    taken = np.array([(1.0, 0.0), (6.0, 0.5)])
    assert clearest_spot(candidates, (4.0, 2.0), taken) == 2
    assert clearest_spot(candidates, (4.0, 2.0), np.empty((0, 2))) == 0
    # Both cover a point; the second covers it nearer to its edge.
    assert clearest_spot(np.array([(1.0, 0.0), (2.5, 0.0)]), (4.0, 2.0), taken[:1]) == 1
