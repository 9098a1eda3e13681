"""Condition orders: balanced in every block, the same for the same seed, different for others."""

from collections import Counter
from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.study.orders import order_at

KEYS = ("mind_meld", "bc", "dagger")


@given(seed=st.integers(0, 2**40), copies=st.integers(1, 3), block=st.integers(0, 50))
@settings(max_examples=60, deadline=None)
def test_every_block_holds_every_order_equally_often(seed, copies, block):
    size = 6 * copies
    drawn = [
        order_at(KEYS, seed=seed, block_size=size, index=block * size + place)
        for place in range(size)
    ]
    assert Counter(drawn) == dict.fromkeys(permutations(KEYS), copies)


@given(seed=st.integers(0, 2**40), index=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_an_order_is_a_matter_of_seed_and_place_alone(seed, index):
    first = order_at(KEYS, seed=seed, block_size=6, index=index)
    assert first == order_at(list(KEYS), seed=seed, block_size=6, index=index)
    assert sorted(first) == sorted(KEYS)


def test_orders_stay_what_they_were():
    """A later version of the program must give what an earlier one assigned."""
    drawn = [order_at(("a", "b", "c"), seed=1, block_size=6, index=i) for i in range(7)]
    assert ["".join(one) for one in drawn] == ["cab", "bca", "cba", "bac", "abc", "acb", "acb"]


@pytest.mark.parametrize(("keys", "orders"), [(("a",), 1), (("a", "b"), 2), ("abcd", 24)])
def test_other_numbers_of_conditions(keys, orders):
    drawn = {order_at(keys, seed=3, block_size=orders, index=i) for i in range(orders)}
    assert len(drawn) == orders


def test_first_places_are_balanced_over_seeds():
    """No order is favoured at the start of a block."""
    first = Counter(order_at(KEYS, seed=s, block_size=6, index=0) for s in range(1200))
    assert len(first) == 6
    assert all(140 < count < 260 for count in first.values())  # 200 expected, sd 13
