import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.calibration import CalibrationConfig, calibrate, encode, spread_rows
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
    ).embeddings
    at_mean = trained.mean_embedding.repeat(6, 1)
    before = difference_loss(trained, windows, at_mean)
    after = difference_loss(trained, windows, found)
    assert (after < 1e-3 * before).all()
    assert (found - true).abs().max() < 0.05


def test_calibration_beats_the_mean_for_everyone(trained, study):
    windows = make_windows(study.calibrate_new, WindowConfig())
    found = calibrate(trained.network, windows, trained.mean_embedding, 0.01).embeddings
    at_mean = trained.mean_embedding.repeat(6, 1)
    before = difference_loss(trained, windows, at_mean)
    after = difference_loss(trained, windows, found)
    assert (after < before).all()
    assert after.sum() < 0.7 * before.sum()


def test_people_are_calibrated_independently(trained, study):
    windows = make_windows(study.calibrate_new, WindowConfig())
    together = calibrate(trained.network, windows, trained.mean_embedding, 0.01).embeddings
    person = study.calibrate_new[-1].person
    alone = [one for one in study.calibrate_new if one.person == person]
    (apart,) = calibrate(
        trained.network, make_windows(alone, WindowConfig()), trained.mean_embedding, 0.01
    ).embeddings
    torch.testing.assert_close(together[-1], apart, atol=0.02, rtol=0.0)


def test_a_network_blind_to_w_leaves_it_at_the_mean(trained, study):
    network = trained.network
    column = network.difference.hidden.weight[:, 16:]
    kept = column.clone()
    try:
        column.zero_()
        windows = make_windows(study.calibrate_new[:2], WindowConfig())
        found = calibrate(network, windows, trained.mean_embedding, 0.0).embeddings
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


def test_a_network_linear_in_w_gives_the_least_squares_solution(trained, study):
    """With every hidden unit on, f is linear in w and the solution is in closed form."""
    network = copy.deepcopy(trained.network)
    f = network.difference
    f.hidden.weight *= 0.01
    f.hidden.bias.fill_(10.0)
    f.out.weight.copy_(torch.randn(1, 200, generator=torch.Generator().manual_seed(0)))
    f.out.bias.copy_(-10.0 * f.out.weight.sum(1))
    windows = make_windows(study.calibrate_new, WindowConfig())
    encoding = encode(network, windows.inputs)
    slope = (f.out.weight[0] @ f.hidden.weight[:, encoding.shape[1] :]).double()
    tight = CalibrationConfig(tolerance=1e-12, iterations=60)
    found = calibrate(network, windows, torch.zeros(4), 0.0, tight)
    at_zero = f(encoding, torch.zeros(len(encoding), 4))
    for index in range(len(windows.people)):
        own = windows.valid & (windows.person == index)
        # Only how far along the slope is determined.
        along = (found.embeddings[index].double() * slope).sum()
        expected = (windows.difference[own] - at_zero[own]).double().mean()
        torch.testing.assert_close(along, expected, atol=1e-3, rtol=1e-3)


def test_w_solves_the_dense_least_squares_of_the_mapper_linearised_there(trained, study):
    """In all of its dimensions: Gauss and Newton's step, solved by QR in float64, lowers nothing.

    The step itself need not be 0: f has kinks, and w may lie on one.
    """
    windows = make_windows(study.calibrate_new, WindowConfig())
    tight = CalibrationConfig(tolerance=1e-12, iterations=200)
    found = calibrate(trained.network, windows, torch.zeros(4), 0.0, tight)
    network = copy.deepcopy(trained.network).double()
    encoding = network.encoder(windows.inputs.double())
    for index in range(len(windows.people)):
        own = windows.valid & (windows.person == index)
        w = found.embeddings[index].double()

        def predicted(w, own=own):
            return network.difference(encoding[own], w.expand(int(own.sum()), -1))

        slope = torch.autograd.functional.jacobian(predicted, w)
        assert torch.linalg.matrix_rank(slope) == 4
        left = windows.difference[own].double() - predicted(w)
        step = torch.linalg.lstsq(slope, left[:, None]).solution[:, 0]
        assert step.abs().max() < 0.02
        for share in (1e-3, 1e-2, 0.1, 0.5, 1.0):
            after = windows.difference[own].double() - predicted(w + share * step)
            assert after.square().sum() > (1.0 - 1e-7) * left.square().sum()


def test_the_difference_is_label_minus_truth(study):
    """Sign of Eq. 2: d = a - o, and mapped = a - d."""
    one = study.calibrate_new[0]
    windows = make_windows([one], WindowConfig())
    expected = (one.label - one.truth)[one.valid]
    np.testing.assert_allclose(windows.difference[windows.valid].numpy(), expected, atol=1e-6)


def test_a_mapper_that_says_d_maps_to_a_minus_d(trained, study):
    one = study.held_out_new[0]
    windows = make_windows([one], WindowConfig())
    network, w = trained.network, trained.embedding_tensor(one.person)
    encoding = encode(network, windows.inputs)
    difference = network.difference(encoding, w.expand(len(encoding), -1)).double().numpy()
    expected = np.clip(one.label - difference, -2.5, 2.5)
    np.testing.assert_allclose(trained.map(one), expected, atol=1e-6)


def test_spread_rows_are_valid_even_and_the_persons_own(study):
    one, two = study.calibrate_new[0], study.calibrate_new[-1]
    rows = spread_rows([one, two, one], 50)
    valid = np.concatenate([one.valid, two.valid, one.valid])
    assert valid[rows].all()
    assert (np.diff(rows) > 0).all()
    second = (rows >= one.steps) & (rows < one.steps + two.steps)
    assert (second.sum(), (~second).sum()) == (50, 50)
    everything = spread_rows([one], 10_000)
    np.testing.assert_array_equal(everything, np.flatnonzero(one.valid))


def test_chosen_rows_are_rows_of_all(study):
    rows = np.array([0, 5, 199, 200, 399])
    everything = make_windows(study.calibrate_new[:2], WindowConfig())
    chosen = make_windows(study.calibrate_new[:2], WindowConfig(), rows)
    assert torch.equal(chosen.inputs, everything.inputs[rows])
    assert torch.equal(chosen.person, everything.person[rows])
    assert torch.equal(chosen.label, everything.label[rows])
