import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from steerlab.learning.kernels.lanes import (
    LANES,
    add_outer,
    add_product,
    copy_lanes,
    exp,
    padded,
    sigmoid,
    tanh,
    transposed,
)

SIZES = st.integers(1, 12).map(lambda tiles: 4 * tiles)


@njit
def each(function, x, out):
    for index in range(len(x)):
        out[index] = function(x[index])


def over(function, x: np.ndarray) -> np.ndarray:
    out = np.empty_like(x)
    each(function, x, out)
    return out.astype(np.float64)


def test_exp_is_good_to_float32s_last_bits():
    x = np.linspace(-86.0, 86.0, 200_001).astype(np.float32)
    np.testing.assert_allclose(over(exp, x), np.exp(x.astype(np.float64)), rtol=5e-7)


def test_the_gates_functions_are_good_to_float32s_last_bits_everywhere():
    x = np.concatenate([np.linspace(-20.0, 20.0, 200_001), [-3e38, -200.0, 200.0, 3e38]])
    x = x.astype(np.float32)
    wide = np.clip(x.astype(np.float64), -80.0, 80.0)
    np.testing.assert_allclose(over(sigmoid, x), 1.0 / (1.0 + np.exp(-wide)), atol=2e-7, rtol=0)
    np.testing.assert_allclose(over(tanh, x), np.tanh(wide), atol=3e-7, rtol=0)
    assert over(tanh, np.zeros(1, np.float32))[0] == 0.0  # so padding stays 0


@pytest.mark.parametrize("function", [exp, sigmoid, tanh])
def test_nan_stays_nan(function):
    assert np.isnan(over(function, np.array([np.nan], np.float32)))


@settings(deadline=None, max_examples=30)
@given(rows=SIZES, columns=SIZES, seed=st.integers(0, 2**31))
def test_products_are_numpys(rows: int, columns: int, seed: int):
    rng = np.random.default_rng(seed)
    weight = rng.normal(size=(rows, columns)).astype(np.float32)
    values = rng.normal(size=(columns, LANES)).astype(np.float32)
    out = rng.normal(size=(rows, LANES)).astype(np.float32)
    expected = out.astype(np.float64) + weight.astype(np.float64) @ values
    got = out.ravel().copy()
    add_product(weight.ravel(), values.ravel(), got)
    np.testing.assert_allclose(got.reshape(out.shape), expected, atol=2e-5)

    expected = weight.astype(np.float64) + out.astype(np.float64) @ values.T
    got = weight.ravel().copy()
    add_outer(out.ravel(), values.ravel(), rows, got)
    np.testing.assert_allclose(got.reshape(weight.shape), expected, atol=1e-4)

    np.testing.assert_array_equal(transposed(weight.ravel(), columns), weight.T.ravel())


def test_steps_are_laid_side_by_side():
    values = np.arange(2 * LANES, dtype=np.float32)
    rows = np.zeros(2 * 3 * LANES, np.float32)
    copy_lanes(values, rows, 3 * LANES, 1)
    expected = np.zeros((2, 3, LANES))
    expected[:, 1] = values.reshape(2, LANES)
    np.testing.assert_array_equal(rows.reshape(2, 3, LANES), expected)


def test_sizes_are_padded_to_tiles():
    assert [padded(size) for size in (1, 4, 5, 32)] == [4, 4, 8, 32]
