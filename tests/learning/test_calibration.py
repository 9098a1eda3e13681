from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.calibration import CalibrationConfig, calibrate, encode
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.windows import WindowConfig, make_windows


def with_known_embeddings(trained, study, true: torch.Tensor):
    """New people's windows whose truth is exactly what the network says for ``true``."""
    windows = make_windows(study.calibrate_new, WindowConfig())
    encoding = encode(trained.network, windows.inputs)
    difference = trained.network.difference(encoding, true[windows.person])
    return replace(windows, truth=windows.label - difference)


def difference_loss(trained, windows, embeddings: torch.Tensor) -> torch.Tensor:
    encoding = encode(trained.network, windows.inputs)
    predicted = trained.network.difference(encoding, embeddings[windows.person])
    square = (predicted - windows.difference).square()
    return torch.zeros(len(windows.people)).index_add_(0, windows.person, square)


def test_a_known_embedding_is_recovered(trained, study):
    spread = torch.randn(6, 4, generator=torch.Generator().manual_seed(0))
    true = trained.mean_embedding + 0.4 * spread
    windows = with_known_embeddings(trained, study, true)
    found = calibrate(
        trained.network, windows, trained.mean_embedding, 0.0, CalibrationConfig(iterations=60)
    )
    at_mean = trained.mean_embedding.repeat(6, 1)
    before = difference_loss(trained, windows, at_mean)
    after = difference_loss(trained, windows, found)
    assert (after < 1e-3 * before).all()
    assert (found - true).abs().max() < 0.05


def test_calibration_beats_the_mean_for_everyone(trained, study):
    windows = make_windows(study.calibrate_new, WindowConfig())
    found = calibrate(trained.network, windows, trained.mean_embedding, 0.01)
    at_mean = trained.mean_embedding.repeat(6, 1)
    before = difference_loss(trained, windows, at_mean)
    after = difference_loss(trained, windows, found)
    assert (after < before).all()
    assert after.sum() < 0.7 * before.sum()


def test_people_are_calibrated_independently(trained, study):
    windows = make_windows(study.calibrate_new, WindowConfig())
    together = calibrate(trained.network, windows, trained.mean_embedding, 0.01)
    person = study.calibrate_new[-1].person
    alone = [one for one in study.calibrate_new if one.person == person]
    (apart,) = calibrate(
        trained.network, make_windows(alone, WindowConfig()), trained.mean_embedding, 0.01
    )
    torch.testing.assert_close(together[-1], apart, atol=0.02, rtol=0.0)


def test_a_network_blind_to_w_leaves_it_at_the_mean(trained, study):
    network = trained.network
    column = network.difference.hidden.weight[:, 16:]
    kept = column.clone()
    try:
        column.zero_()
        windows = make_windows(study.calibrate_new[:2], WindowConfig())
        found = calibrate(network, windows, trained.mean_embedding, 0.0)
    finally:
        column.copy_(kept)
    assert torch.equal(found, trained.mean_embedding.repeat(1, 1))


def test_someone_without_a_valid_label_is_named(trained, study):
    one = study.calibrate_new[0]
    blank = replace(one, valid=np.zeros(one.steps, dtype=bool))
    with pytest.raises(InvalidLabels, match=one.person):
        calibrate(
            trained.network,
            make_windows([blank], WindowConfig()),
            trained.mean_embedding,
            0.01,
        )
