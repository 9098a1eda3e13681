"""One contract for every mapper, and what MIND MELD must do beyond it."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning.baselines import (
    BASELINES,
    CEILING,
    MeanEmbeddingMapper,
    PersonGainMapper,
)
from steerlab.learning.errors import NotFitted, UnknownPerson
from steerlab.learning.label_quality import label_quality, mapper_quality
from steerlab.learning.mapper import LabelMapper, MindMeldMapper, stack_embeddings
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.series import LabelSeries
from steerlab.sim.vehicle import WHEEL_LIMIT

NAMES = (*BASELINES, CEILING, "mind_meld_0.2_s")


@pytest.fixture(params=NAMES, name="mapper")
def _mapper(request: pytest.FixtureRequest, ladder: dict[str, LabelMapper]) -> LabelMapper:
    return ladder[request.param]


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


class TestContract:
    def test_mapped_labels_keep_shape_and_limits(self, mapper: LabelMapper, study):
        for one in (study.held_out_seen[0], study.held_out_new[-1]):
            mapped = mapper.map(one)
            assert mapped.shape == (one.steps,)
            assert mapped.dtype == np.float64
            assert np.abs(mapped).max() <= WHEEL_LIMIT

    def test_mapping_twice_gives_the_same(self, mapper: LabelMapper, study):
        one = study.held_out_new[0]
        np.testing.assert_array_equal(mapper.map(one), mapper.map(one))

    def test_the_truth_is_never_read(self, mapper: LabelMapper, study):
        one = study.held_out_new[0]
        blind = replace(
            one, truth=np.full(one.steps, np.nan), valid=np.zeros(one.steps, dtype=bool)
        )
        np.testing.assert_array_equal(mapper.map(one), mapper.map(blind))

    def test_a_missing_label_stays_missing(self, mapper: LabelMapper, study):
        one = study.held_out_new[0]
        label = one.label.copy()
        label[20:25] = np.nan
        holed = replace(one, label=label, valid=np.isfinite(label))
        mapped = mapper.map(holed)
        assert np.isnan(mapped).tolist() == np.isnan(label).tolist()

    def test_it_has_a_name(self, mapper: LabelMapper):
        assert mapper.name in NAMES
        assert isinstance(mapper.name, str)

    def test_calibrating_someone_again_changes_no_one_else(self, mapper: LabelMapper, study):
        one, other = study.held_out_new[0], study.held_out_seen[0]
        mapper = deepcopy(mapper)  # the others share it
        before = mapper.map(other)
        mapper.calibrate([s for s in study.calibrate_new if s.person == one.person])
        np.testing.assert_array_equal(mapper.map(other), before)


def test_mind_meld_improves_seen_and_new_people_and_beats_the_ladder(trained, study):
    gain = PersonGainMapper()
    gain.fit(study.train_seen)
    gain.calibrate(study.calibrate_new)
    for part, least in ((study.held_out_seen, 0.4), (study.held_out_new, 0.4)):
        mind_meld = mapper_quality(trained, part, rng())
        assert mind_meld.improvement > least
        assert mind_meld.people_improved > 0.8
        for baseline in (gain, MeanEmbeddingMapper(trained)):
            assert mind_meld.improvement > mapper_quality(baseline, part, rng()).improvement


def test_style_is_recovered(trained, people):
    seen = stack_embeddings(trained, [one.name for one in people["seen"]])
    probe = StyleProbe.fit(seen, style_parameters([one.style for one in people["seen"]]))
    new = stack_embeddings(trained, [one.name for one in people["new"]])
    rank = probe.spearman_new(new, style_parameters([one.style for one in people["new"]]))
    assert rank["log_gain"] > 0.7
    assert rank["delay_s"] > 0.5


@pytest.mark.parametrize("edge", ["first", "last"])
def test_edges_are_not_made_worse_than_raw(trained, study, edge: str):
    raw, mapped, truth = [], [], []
    for one in (*study.held_out_seen, *study.held_out_new):
        second = slice(None, 20) if edge == "first" else slice(-20, None)
        raw.append(one.label[second])
        mapped.append(trained.map(one)[second])
        truth.append(one.truth[second])
    raw, mapped, truth = np.concatenate(raw), np.concatenate(mapped), np.concatenate(truth)
    assert label_quality(np.zeros(len(raw)), raw, mapped, truth, rng()).improvement > 0.1


def test_another_control_rate_maps_to_the_same_labels(trained, study, rollouts):
    one = study.held_out_seen[0]
    t_s = np.arange(one.steps) / one.rate_hz
    fine_t_s = np.arange(5 * one.steps - 4) / (5 * one.rate_hz)
    label = np.interp(fine_t_s, t_s, one.label)
    fine = LabelSeries(
        person=one.person,
        rollout=one.rollout,
        rate_hz=5 * one.rate_hz,
        label=label,
        truth=np.full(len(label), np.nan),
        valid=np.zeros(len(label), dtype=bool),
    )
    np.testing.assert_allclose(trained.map(fine)[::5], trained.map(one), atol=1e-5)


def test_someone_unknown_and_an_unfitted_mapper_say_what_to_call(trained, study, quick_config):
    stranger = replace(study.held_out_new[0], person="stranger")
    with pytest.raises(UnknownPerson, match=r"'stranger'; it knows seen-000.*calibrate"):
        trained.map(stranger)
    fresh = MindMeldMapper(quick_config, seed=0)
    with pytest.raises(NotFitted, match="call fit"):
        fresh.calibrate(study.calibrate_new)
    with pytest.raises(UnknownPerson, match="no one"):
        fresh.map(stranger)
    with pytest.raises(NotFitted, match="call fit"):
        MeanEmbeddingMapper(fresh).map(stranger)


def test_calibration_leaves_the_seen_people_alone(trained, study):
    assert trained.people == tuple(
        dict.fromkeys(one.person for one in (*study.train_seen, *study.calibrate_new))
    )
    seen = study.held_out_seen[0].person
    assert len(trained.embedding(seen)) == 4
    assert len(trained.history) == trained.config.training.epochs


def test_same_seed_same_labels_for_seen_and_new_people(study, quick_config):
    config = replace(quick_config, training=replace(quick_config.training, epochs=2))
    mapped = []
    for _ in range(2):
        mapper = MindMeldMapper(config, seed=1)
        mapper.fit(study.train_seen[:10])
        mapper.calibrate(study.calibrate_new[:2])
        mapped.append([mapper.map(study.train_seen[0]), mapper.map(study.calibrate_new[0])])
    np.testing.assert_array_equal(mapped[0], mapped[1])
