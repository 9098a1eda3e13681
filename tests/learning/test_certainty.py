from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from steerlab.learning.certainty import Calibrated, TrainingPeople
from steerlab.learning.checkpoint import load_mapper, save_mapper
from steerlab.learning.errors import InvalidLabels, UnknownPerson


def people_of(count: int, size: int = 4, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, size))


def test_many_people_give_chi_square_and_few_a_wider_region():
    many, few = TrainingPeople.of(people_of(100_000)), TrainingPeople.of(people_of(12))
    assert many.furthest(0.99) == pytest.approx(np.sqrt(chi2.ppf(0.99, 4)), rel=1e-3)
    assert few.furthest(0.99) > 1.3 * many.furthest(0.99)


def test_people_like_them_are_warned_of_as_often_as_said():
    """Over many small studies; the region is exact for normal embeddings."""
    rng, outside = np.random.default_rng(1), 0
    for _ in range(2000):
        drawn = rng.normal(size=(13, 3))
        training = TrainingPeople.of(drawn[:12])
        outside += training.distance(drawn[12]) > training.furthest(0.9)
    assert 0.08 < outside / 2000 < 0.12


def test_too_few_people_to_tell():
    training = TrainingPeople.of(people_of(5))
    assert training.distance(np.full(4, 100.0)) is None
    judged = training.judge("p", np.full(4, 100.0), np.eye(4), np.ones(4))
    assert not judged.outside
    assert judged.distance is None


def test_a_far_embedding_is_warned_of(caplog):
    training = TrainingPeople.of(people_of(34))
    near = training.judge("near", np.zeros(4), np.eye(4), np.ones(4))
    assert not near.outside
    assert caplog.text == ""
    far = training.judge("far", np.full(4, 9.0), np.eye(4), np.ones(4))
    assert far.outside
    assert "far has a style unlike the 34 training people's" in caplog.text


def test_labels_without_information_leave_the_prior():
    training = TrainingPeople.of(people_of(34))
    judged = training.judge("p", np.zeros(4), np.zeros((4, 4)), np.ones(4))
    np.testing.assert_allclose(judged.covariance, training.covariance, atol=1e-10)
    sharp = training.judge("p", np.zeros(4), 1e6 * np.eye(4), np.ones(4))
    assert (sharp.sigma < 2e-3).all()


def test_every_calibrated_person_has_a_record(trained, study, people):
    for teacher in people["new"]:
        record = trained.calibration(teacher.name)
        np.testing.assert_allclose(record.embedding, trained.embedding(teacher.name))
        assert (np.linalg.eigvalsh(record.covariance) > 0.0).all()
        assert (record.g_sigma > 0.0).all()
        assert record.distance is not None
    with pytest.raises(UnknownPerson, match="not calibrated 'seen-000'"):
        trained.calibration("seen-000")


def test_more_labels_leave_less_open(trained, study):
    person = study.calibrate_new[0].person
    own = [one for one in study.calibrate_new if one.person == person]
    few = [replace(one, person="few") for one in own[:1]]
    many = [replace(one, person="many") for one in own]
    trained_copy = type(trained).from_trained(
        trained.config, trained.seed, trained.network, trained.training_embeddings, {}, {}
    )
    trained_copy.calibrate([*few, *many])
    volume = {
        name: np.linalg.slogdet(trained_copy.calibration(name).covariance)[1]
        for name in ("few", "many")
    }
    assert volume["many"] < volume["few"] - 1.0


def test_a_style_nobody_has_is_warned_of(trained, study, caplog):
    """Labels with the sign turned are far from every training person's."""
    one = study.calibrate_new[0]
    mapper = type(trained).from_trained(
        trained.config, trained.seed, trained.network, trained.training_embeddings, {}, {}
    )
    mapper.calibrate([replace(one, person="contrary", label=-one.label)])
    assert mapper.calibration("contrary").outside
    assert "contrary has a style unlike" in caplog.text


def test_records_survive_the_checkpoint(trained, tmp_path):
    save_mapper(trained, tmp_path / "m.safetensors")
    loaded = load_mapper(tmp_path / "m.safetensors")
    assert loaded.calibrated == trained.calibrated
    for person in trained.calibrated:
        one, two = trained.calibration(person), loaded.calibration(person)
        np.testing.assert_array_equal(one.covariance, two.covariance)
        np.testing.assert_array_equal(one.g_sigma, two.g_sigma)
        assert (one.distance, one.outside) == (two.distance, two.outside)


def test_a_record_that_does_not_fit_itself_is_refused():
    with pytest.raises(InvalidLabels, match="do not fit"):
        Calibrated(
            embedding=np.zeros(4),
            covariance=np.eye(3),
            g_sigma=np.zeros(4),
            distance=None,
            outside=False,
        )
