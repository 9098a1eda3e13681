"""The error to expect of each mapped label, and intervals from it."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.errors import InvalidLabels, NotFitted
from steerlab.learning.pretrained.expected_error import ErrorScale, measure_error_scale
from steerlab.learning.pretrained.fine_tuning import FineTuningConfig, fine_tuned, study_batch
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.pretrained.model import ResidualNetwork
from steerlab.learning.pretrained.weights import load_shipped_model
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT


@pytest.fixture(scope="module", name="mapper")
def _mapper(study) -> SimPretrainedMapper:
    mapper = SimPretrainedMapper(fine_tuning=None)
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    return mapper


def test_errors_twice_as_large_as_stated_double_every_interval():
    stated = np.linspace(0.1, 0.9, 50)
    errors = ErrorScale.from_errors(2.0 * stated, stated)
    assert errors.factor == pytest.approx(2.0)
    assert errors.half_width(0.5) == pytest.approx(2.0)
    assert errors.half_width(0.95) == pytest.approx(2.0)


def test_half_widths_are_quantiles_of_actual_over_stated():
    rng = np.random.default_rng(0)
    stated = rng.uniform(0.1, 1.0, 40_000)
    errors = ErrorScale.from_errors(stated * rng.exponential(1.0, 40_000), stated)
    for share in (0.5, 0.8, 0.95):
        assert errors.half_width(share) == pytest.approx(-math.log(1.0 - share), rel=0.03)


@pytest.mark.parametrize("share", [0.0, 1.0, -0.1, 80.0, float("nan")])
def test_a_share_that_is_none_is_refused(share: float):
    with pytest.raises(InvalidConfig, match="share"):
        ErrorScale.from_errors(np.ones(3), np.ones(3)).half_width(share)


def test_no_label_gives_no_scale():
    with pytest.raises(InvalidLabels, match="No label"):
        ErrorScale.from_errors(np.empty(0), np.empty(0))


def test_stated_errors_and_intervals_hold_on_held_out_rollouts(mapper, study):
    for part in (study.held_out_seen, study.held_out_new):
        stated: list[np.ndarray] = []
        actual: list[np.ndarray] = []
        inside = {0.5: 0.0, 0.8: 0.0, 0.95: 0.0}
        for one in part:
            mapped, spread = mapper.map_with_spread(one)
            stated.append(spread[one.valid])
            actual.append(np.abs(mapped - one.truth)[one.valid])
            for share in inside:
                _, low, high = mapper.map_with_interval(one, share)
                within = (low <= one.truth) & (one.truth <= high)
                inside[share] += float(within[one.valid].sum())
        spreads, errors = np.concatenate(stated), np.concatenate(actual)
        assert spreads.mean() == pytest.approx(errors.mean(), rel=0.25)
        least_sure = np.argsort(spreads)[-len(spreads) // 4 :]
        assert errors[least_sure].mean() > 1.5 * errors.mean()
        for share, count in inside.items():
            assert count / len(errors) == pytest.approx(share, abs=0.08)


def test_an_interval_lies_around_the_mapped_label_and_within_the_wheel(mapper, study):
    one = study.held_out_new[0]
    mapped, low, high = mapper.map_with_interval(one, 0.95)
    np.testing.assert_array_equal(mapped, mapper.map(one))
    assert (low <= mapped).all()
    assert (mapped <= high).all()
    assert low.min() >= -WHEEL_LIMIT
    assert high.max() <= WHEEL_LIMIT
    _, narrower, _ = mapper.map_with_interval(one, 0.5)
    assert (narrower >= low).all()
    assert (narrower > low).any()


def test_a_network_that_boasts_is_corrected(mapper, study):
    """A network that states a third of what another states has the same intervals in the end."""
    model = load_shipped_model()
    network = ResidualNetwork(model.network.config, torch.Generator().manual_seed(0))
    network.load_state_dict(model.network.state_dict())
    with torch.no_grad():
        network.out.get_parameter("bias")[1::2] -= math.log(3.0)
    boasting = SimPretrainedMapper(
        model=replace(model, network=network.requires_grad_(False)), fine_tuning=None
    )
    boasting.fit(study.train_seen)
    one = study.held_out_seen[0]
    assert boasting.error_scale.factor == pytest.approx(3.0 * mapper.error_scale.factor, rel=1e-4)
    for ours, theirs in zip(
        mapper.map_with_spread(one), boasting.map_with_spread(one), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-6)
    for ours, theirs in zip(
        mapper.map_with_interval(one, 0.8), boasting.map_with_interval(one, 0.8), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-6)


def test_without_a_second_rollout_nothing_is_expected_and_labels_are_still_mapped(study):
    one_each = list({one.person: one for one in study.train_seen}.values())
    for prepare in (SimPretrainedMapper.fit, SimPretrainedMapper.calibrate):
        mapper = SimPretrainedMapper(fine_tuning=None)
        prepare(mapper, one_each)
        assert np.isfinite(mapper.map(one_each[0])).all()
        with pytest.raises(NotFitted, match="two or more rollouts"):
            mapper.map_with_spread(one_each[0])
        with pytest.raises(NotFitted, match="two or more rollouts"):
            mapper.map_with_interval(one_each[0], 0.8)


def test_a_fine_tuned_network_is_measured_on_rollouts_it_has_not_seen(study):
    model = load_shipped_model()
    batch = study_batch(model, study.train_seen, None)
    assert batch is not None
    tuned = fine_tuned(model, batch, 0, FineTuningConfig(steps=2, margin=-9.0))
    seen = {name for name, unseen in zip(batch.rollout, tuned.unseen, strict=True) if not unseen}
    assert 0 < tuned.unseen.sum() < len(batch.rollout)
    assert seen.isdisjoint(np.array(batch.rollout)[tuned.unseen])
    frozen = fine_tuned(model, batch, 0, FineTuningConfig(steps=2, margin=9.0))
    assert frozen.network is model.network
    assert frozen.unseen.all()
    errors = measure_error_scale(model, tuned.network, batch, tuned.unseen)
    mapper = SimPretrainedMapper(fine_tuning=FineTuningConfig(steps=2, margin=-9.0))
    mapper.fit(study.train_seen)
    assert mapper.error_scale.factor == errors.factor
    np.testing.assert_array_equal(mapper.error_scale.quantiles, errors.quantiles)
