"""The style that calibration finds, and the drives and teachers it is learned from."""

import numpy as np
import pytest

from steerlab.learning.empirical_bayes.grid import RATE_HZ
from steerlab.learning.pretrained.drives import generate_drives
from steerlab.learning.pretrained.model import Alignment
from steerlab.learning.pretrained.style import (
    DELAYS_S,
    FORWARD_FEATURES,
    SIGNED,
    STYLE_SIZE,
    forward_features,
    mirrored_style,
    style_moments,
    truth_unit,
)
from steerlab.learning.pretrained.weights import load_shipped_model
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT


def test_a_forward_tap_is_the_truth_some_time_ago():
    truth = np.sin(np.arange(200) / 10.0)
    features = forward_features(truth)
    assert features.shape == (200, FORWARD_FEATURES)
    half_a_second = int(np.argmin(np.abs(DELAYS_S - 0.5)))
    np.testing.assert_allclose(features[50:, half_a_second], truth[40:-10], atol=0.01)


def test_labels_at_the_stop_do_not_enter_the_forward_model():
    rng = np.random.default_rng(0)
    truth = np.cumsum(rng.normal(0.0, 0.2, (1, 200)), axis=1).clip(-2.0, 2.0)
    label = truth.copy()
    label[0, 100:110] = WHEEL_LIMIT
    valid = np.ones((1, 200), dtype=bool)
    unit = np.ones(1)
    free = style_moments(truth, truth, valid, unit)
    clipped = style_moments(label, truth, valid, unit)
    assert free.forward.rows[0] - clipped.forward.rows[0] == 10
    assert free.inverse.rows[0] == clipped.inverse.rows[0]


def test_moments_of_rollouts_add_up():
    rng = np.random.default_rng(1)
    label, truth = rng.normal(0.0, 0.7, (2, 4, 100))
    moments = style_moments(label, truth, np.ones((4, 100), dtype=bool), np.ones(4))
    by_weights = moments.grouped(np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]]))
    by_order = moments.summed(2)
    np.testing.assert_allclose(by_weights.sums, by_order.sums)
    np.testing.assert_allclose(by_weights.forward.xx, by_order.forward.xx)
    np.testing.assert_allclose(moments[1:2].sums[0], moments.sums[1])


@pytest.mark.parametrize(("gain", "delay_s"), [(0.6, 0.0), (1.0, 0.3), (1.5, -0.2)])
def test_gain_and_delay_of_a_noise_free_teacher_are_read(gain: float, delay_s: float):
    t_s = np.arange(300) / RATE_HZ

    def truth_at(t_s: np.ndarray) -> np.ndarray:
        return 0.8 * np.sin(1.3 * t_s) + 0.5 * np.sin(2.9 * t_s + 1.0)

    model = load_shipped_model()
    label, truth = gain * truth_at(t_s - delay_s), truth_at(t_s)
    valid = np.ones((1, 300), dtype=bool)
    unit = np.array([truth_unit(truth, valid[0])])
    moments = style_moments(label[None], truth[None], valid, unit)
    _, style = model.encoder(moments)
    alignment = Alignment.from_style(style, model.style_readout)
    assert alignment.gain[0] == pytest.approx(gain, rel=0.2)
    assert alignment.delay_s[0] == pytest.approx(delay_s, abs=0.1)
    assert np.abs(style).max() <= 4.0


def test_what_labels_are_measured_in_changes_nothing_but_the_unit():
    """Twice the labels and truths, far from the stop, are the same style in a larger unit."""
    rng = np.random.default_rng(5)
    truth = np.cumsum(rng.normal(0.0, 0.05, 300)).clip(-1.0, 1.0)
    label = (0.7 * truth + rng.normal(0.0, 0.05, 300)).clip(-1.0, 1.0)
    valid = np.ones((1, 300), dtype=bool)
    model = load_shipped_model()
    found = []
    for scale in (1.0, 2.0):
        unit = np.array([truth_unit(scale * truth, valid[0])])
        one = style_moments(scale * label[None], scale * truth[None], valid, unit)
        found.append(model.encoder(one))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-6, atol=1e-9)
    assert (np.abs(found[0][1] - found[1][1]) > 1e-6).sum() == 1


def test_mirroring_a_style_twice_gives_it_back():
    style = np.random.default_rng(2).normal(size=(3, STYLE_SIZE))
    np.testing.assert_array_equal(mirrored_style(mirrored_style(style)), style)
    assert (mirrored_style(style)[:, list(SIGNED)] == -style[:, list(SIGNED)]).all()


def test_no_worlds_are_refused():
    with pytest.raises(InvalidConfig, match="worlds"):
        generate_drives(0, 0, 3)


@pytest.mark.slow
def test_drives_are_seeded_and_valid():
    first, again = generate_drives(5, 1, 1), generate_drives(5, 1, 1)
    assert len(first) == 1
    np.testing.assert_array_equal(first[0].truth, again[0].truth)
    assert np.abs(first[0].truth).max() <= WHEEL_LIMIT
    assert first[0].motion.shape == (len(first[0].truth), 3)
