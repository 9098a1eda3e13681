"""The closed forms against dense algebra, and the simulation-free mapper."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.empirical_bayes.gaussian import (
    Moments,
    Prior,
    fit_prior,
    given_noise,
    posterior,
)
from steerlab.learning.empirical_bayes.grid import (
    BIAS,
    FEATURES,
    RATE_HZ,
    TAPS,
    GridSeries,
    from_grid,
    label_features,
    whole_window,
)
from steerlab.learning.empirical_bayes.mapper import EmpiricalBayesMapper
from steerlab.learning.errors import InvalidLabels, NotFitted, UnknownPerson
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.series import LabelSeries
from steerlab.sim.vehicle import WHEEL_LIMIT


def series(label: np.ndarray, rate_hz: float = RATE_HZ) -> LabelSeries:
    label = np.asarray(label, dtype=np.float64)
    return LabelSeries(
        person="p",
        rollout="r",
        rate_hz=rate_hz,
        label=label,
        truth=label.copy(),
        valid=np.isfinite(label),
    )


class TestGaussian:
    def test_the_posterior_is_that_of_the_joint_gaussian(self):
        """Conditioning the dense joint of (beta, y) on y, row by row of the data."""
        rng = np.random.default_rng(0)
        x, y = rng.normal(size=(7, 3)), rng.normal(size=7)
        root = rng.normal(size=(3, 3))
        mean, covariance, noise = rng.normal(size=3), root @ root.T + np.eye(3), 0.4
        marginal = x @ covariance @ x.T + noise * np.eye(7)
        gain = covariance @ x.T @ np.linalg.inv(marginal)
        precision = np.linalg.inv(covariance)
        found_mean, found_covariance = given_noise(
            Moments.of(x, y), 1.0, precision, precision @ mean, np.array([noise])
        )
        np.testing.assert_allclose(found_mean[0], mean + gain @ (y - x @ mean))
        np.testing.assert_allclose(found_covariance[0], covariance - gain @ x @ covariance)

    def test_temper_counts_each_row_as_a_share(self):
        rng = np.random.default_rng(1)
        x, y = rng.normal(size=(5, 2)), rng.normal(size=5)
        one, zero = np.array([1.0]), np.zeros(2)
        tempered = given_noise(Moments.of(x, y), 0.1, np.eye(2), zero, one)
        ten = Moments.of(np.tile(x, (10, 1)), np.tile(y, 10))
        repeated = given_noise(ten, 0.01, np.eye(2), zero, one)
        np.testing.assert_allclose(tempered[0], repeated[0])

    def test_em_finds_the_moment_estimate_of_a_balanced_one_way_layout(self):
        """y = beta_p + noise: there REML's between variance is known in closed form."""
        rng = np.random.default_rng(2)
        people, rows, mean, between, within = 400, 20, 1.5, 0.7, 0.5
        beta = rng.normal(mean, between, people)
        y = beta[:, None] + rng.normal(0.0, within, (people, rows))
        moments = Moments.concatenate([Moments.of(np.ones((rows, 1)), one) for one in y])
        prior = fit_prior(moments, temper=1.0, iterations=200, shrinkage_people=0.0)
        averages = y.mean(axis=1)
        expected = averages.var() - y.var(axis=1, ddof=1).mean() / rows
        assert prior.mean[0] == pytest.approx(averages.mean(), abs=1e-3)
        assert prior.covariance[0, 0] == pytest.approx(expected, rel=0.02)
        assert prior.noise == pytest.approx(within**2, rel=0.05)

    def test_a_person_without_rows_is_the_prior(self):
        prior = Prior(mean=np.array([1.0, 2.0]), covariance=np.eye(2), noise=0.3)
        nothing = Moments.of(np.zeros((0, 2)), np.zeros(0))
        found = posterior(nothing, prior)
        np.testing.assert_allclose(found.mean[0], prior.mean)
        assert found.noise[0] == pytest.approx(0.3)

    def test_rollouts_add_up(self):
        rng = np.random.default_rng(3)
        x, y = rng.normal(size=(9, 2)), rng.normal(size=9)
        parts = Moments.concatenate([Moments.of(x[:4], y[:4]), Moments.of(x[4:], y[4:])])
        whole = Moments.of(x, y)
        for added in (parts.summed(1), parts.grouped(np.ones((1, 2)))):
            for name in ("xx", "xy", "yy", "rows"):
                np.testing.assert_allclose(getattr(added, name), getattr(whole, name))

    def test_one_person_has_no_prior(self):
        with pytest.raises(InvalidLabels, match="at least two"):
            fit_prior(Moments.of(np.ones((3, 1)), np.ones(3)))


class TestFeatures:
    def test_a_constant_label_has_constant_taps(self):
        features = label_features(np.full(60, 0.7))
        assert features.shape == (60, FEATURES)
        np.testing.assert_allclose(features[:, :TAPS], 0.7)
        np.testing.assert_allclose(features[:, BIAS], 1.0)

    @given(st.integers(0, 2**32 - 1))
    @settings(max_examples=20, deadline=None)
    def test_all_but_the_bias_are_odd(self, seed: int):
        label = np.random.default_rng(seed).uniform(-2.5, 2.5, (2, 50))
        features, mirrored = label_features(label), label_features(-label)
        np.testing.assert_allclose(np.delete(mirrored, BIAS, -1), -np.delete(features, BIAS, -1))

    def test_a_label_at_the_stop_is_flagged_with_its_side(self):
        label = np.array([0.0, WHEEL_LIMIT, -WHEEL_LIMIT, 2.4])
        flag = label_features(label)[:, FEATURES - 2]
        assert flag.tolist() == [0.0, 1.0, -1.0, 0.0]

    def test_a_tap_reads_the_label_a_tenth_of_a_second_away(self):
        label = np.zeros(80)
        label[40] = 1.0
        features = label_features(label)
        assert features[40, TAPS // 2] == 0.5  # smoothed over the neighbours
        assert features[30, TAPS // 2 + 5] == 0.5  # half a second ahead

    def test_whole_window_knows_ends_and_holes(self):
        present = np.ones(200, dtype=bool)
        present[100] = False
        whole = whole_window(present)
        assert not whole[:21].any()
        assert not whole[-21:].any()
        assert not whole[79:122].any()
        assert whole[21:79].all()
        assert whole[122:-21].all()


class TestGrid:
    def test_at_its_own_rate_nothing_changes(self):
        one = series(np.sin(np.arange(50) / 5.0))
        grid = GridSeries.from_series(one)
        np.testing.assert_array_equal(grid.label, one.label)
        np.testing.assert_array_equal(from_grid(grid.label, one), one.label)

    @pytest.mark.parametrize("rate_hz", [10.0, 15.0, 30.0, 60.0, 100.0])
    def test_other_rates_are_read_between_steps(self, rate_hz: float):
        one = series(np.linspace(0.0, 2.0, 101), rate_hz)
        grid = GridSeries.from_series(one)
        t_s = np.arange(len(grid.label)) / RATE_HZ
        np.testing.assert_allclose(grid.label, 0.02 * rate_hz * t_s, atol=1e-9)
        assert grid.present.all()

    def test_a_hole_is_bridged_and_marked(self):
        label = np.linspace(0.0, 1.0, 11)
        label[4:6] = np.nan
        grid = GridSeries.from_series(series(label))
        np.testing.assert_allclose(grid.label, np.linspace(0.0, 1.0, 11))
        assert (~grid.present).nonzero()[0].tolist() == [4, 5]
        assert (grid.valid == grid.present).all()


@pytest.fixture(scope="module")
def fitted(study) -> EmpiricalBayesMapper:
    mapper = EmpiricalBayesMapper()
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    return mapper


class TestMapper:
    def test_it_improves_seen_and_new_people(self, fitted, study):
        rng = np.random.default_rng(0)
        for part in (study.held_out_seen, study.held_out_new):
            assert mapper_quality(fitted, part, rng).improvement > 0.5

    def test_missing_labels_stay_missing_and_the_truth_is_not_read(self, fitted, study):
        one = study.held_out_new[0]
        label = one.label.copy()
        label[:5] = label[20:25] = np.nan
        blind = replace(
            one, label=label, truth=np.full(one.steps, np.nan), valid=np.zeros(one.steps, bool)
        )
        mapped = fitted.map(blind)
        assert np.isnan(mapped).tolist() == np.isnan(label).tolist()
        assert np.nanmax(np.abs(mapped)) <= WHEEL_LIMIT

    def test_masked_steps_do_not_train(self, study):
        """What a masked step holds makes no difference."""
        mapped: list[np.ndarray] = []
        for filler in (0.0, 2.0):
            holed: list[LabelSeries] = []
            for one in study.train_seen:
                truth, valid = one.truth.copy(), one.valid.copy()
                truth[100:], valid[100:] = filler, False
                holed.append(replace(one, truth=truth, valid=valid))
            mapper = EmpiricalBayesMapper()
            mapper.fit(holed)
            mapped.append(mapper.map(study.held_out_seen[0]))
        np.testing.assert_array_equal(mapped[0], mapped[1])

    def test_it_says_what_is_missing(self, study):
        mapper = EmpiricalBayesMapper()
        with pytest.raises(NotFitted, match="call fit"):
            mapper.calibrate(study.calibrate_new)
        with pytest.raises(UnknownPerson, match="calibrate"):
            mapper.map(study.held_out_new[0])
        with pytest.raises(InvalidLabels, match="at least one"):
            mapper.fit([])
        one = study.train_seen[0]
        with pytest.raises(InvalidLabels, match=one.person):
            mapper.fit([replace(one, valid=np.zeros(one.steps, dtype=bool))])
