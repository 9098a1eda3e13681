"""How much of the network's correction counts, and what must not be known when that is measured."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.pretrained.known_people import known_from_others, prior_of
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.pretrained.weights import load_shipped_model
from steerlab.learning.series import LabelSeries
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population


@pytest.fixture(scope="module")
def misled():
    """The shipped model with a network that adds half a unit to whatever it is given."""
    model = load_shipped_model()
    network = deepcopy(model.network)
    with torch.no_grad():
        network.out.weight.zero_()
        network.out.bias.copy_(torch.tensor([0.5, 0.0, 0.5, 0.0]))
        # Averaged with the mirror image a constant cancels out, so it must depend on the side.
        network.out.weight[0] = network.out.weight[2] = 0.3
    return replace(model, network=network)


def test_a_network_that_misleads_is_not_believed(misled, study):
    mapper = SimPretrainedMapper(model=misled, fine_tuning=None)
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    assert mapper.correction_share <= 0.2
    rng = np.random.default_rng(0)
    kept = mapper_quality(mapper, study.held_out_new, rng).improvement
    mapper._correction_share = 1.0
    assert mapper_quality(mapper, study.held_out_new, rng).improvement < kept - 0.02


def test_a_network_that_helps_counts_in_full(study):
    mapper = SimPretrainedMapper(fine_tuning=None)
    mapper.fit(study.train_seen)
    assert mapper.correction_share >= 0.9


def test_what_is_known_from_others_does_not_know_the_rollout_itself(study):
    """Another truth and other labels of one drive change nothing of how that drive is mapped."""
    model = load_shipped_model()
    drive = study.train_seen[0].rollout
    other = [
        replace(one, label=-one.label[::-1].copy(), truth=one.truth[::-1].copy())
        if one.rollout == drive
        else one
        for one in study.train_seen
    ]
    (kept, known), (_, changed) = (
        known_from_others(model, series, None) for series in (study.train_seen, other)
    )
    same = [row for row, at in enumerate(kept) if study.train_seen[at].rollout == drive]
    apart = [row for row in range(len(kept)) if row not in same]
    assert np.allclose(
        known.coefficients[same],
        changed.coefficients[same],
        atol=0.05,
    )
    assert np.abs(known.coefficients[apart] - changed.coefficients[apart]).max() > 0.05


def test_two_people_have_nothing_in_common_that_one_could_tell(study):
    model = load_shipped_model()
    people = list(dict.fromkeys(one.person for one in study.train_seen))
    two = [one for one in study.train_seen if one.person in people[:2]]
    assert prior_of(model, two) is None
    three = [one for one in study.train_seen if one.person in people[:3]]
    assert prior_of(model, three) is not None


def test_who_is_unlike_all_simulated_people_is_told():
    """People of a population on the shipped drives are not; one whose hand is a coin is."""
    drives = load_calibration_set()[:5]
    series = [
        LabelSeries(
            person=teacher.name,
            rollout=drive.name,
            rate_hz=drive.control_hz,
            label=teacher.respond(drive, order=order, attempt=0),
            truth=drive.oracle_label,
            valid=drive.oracle_valid,
        )
        for teacher in sample_population("human", 6, 100, prefix="seen")
        for order, drive in enumerate(drives)
    ]
    mapper = SimPretrainedMapper(fine_tuning=None)
    mapper.calibrate(series)
    assert not any(mapper.is_unlike(person) for person in mapper.people)
    rng = np.random.default_rng(1)
    mapper.calibrate(
        [
            replace(one, person="strange", label=np.where(rng.random(one.steps) < 0.5, 2.5, -2.5))
            for one in series[:5]
        ]
    )
    assert mapper.is_unlike("strange")
