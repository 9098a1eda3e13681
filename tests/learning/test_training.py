from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.training import TrainingConfig, mind_meld_loss, torch_threads, train
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.errors import InvalidConfig

SHORT = TrainingConfig(epochs=3, batch_size=128, share_per_epoch=0.1, least_per_epoch=1)


@pytest.fixture(scope="module", name="windows")
def _windows(study):
    return make_windows(study.train_seen[:12], WindowConfig())


def trained_bits(windows, seed: int, threads: int = 1) -> list[torch.Tensor]:
    result = train(windows, NetworkConfig(), replace(SHORT, threads=threads), seed)
    return [result.embeddings, *result.network.state_dict().values()]


def test_same_seed_same_bits_and_no_global_state(windows):
    before = torch.random.get_rng_state()
    first = trained_bits(windows, 7)
    torch.manual_seed(123)
    second, other = trained_bits(windows, 7), trained_bits(windows, 8)
    assert all(torch.equal(one, two) for one, two in zip(first, second, strict=True))
    assert not torch.equal(first[0], other[0])
    torch.random.set_rng_state(before)


def test_with_several_threads_it_repeats_as_well(windows):
    one, two = (trained_bits(windows, 7, threads=3) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(one, two, strict=True))


def test_the_callers_threads_change_no_bit(windows):
    one = trained_bits(windows, 7)
    with torch_threads(3):
        two = trained_bits(windows, 7)
    assert all(torch.equal(a, b) for a, b in zip(one, two, strict=True))


@pytest.mark.parametrize("config", [SHORT, replace(SHORT, mirror=False, huber=None, cosine=False)])
def test_training_is_the_plain_loop_over_the_definition(windows, config):
    """The same draws, ``mind_meld_loss``, autograd and one Adam for all."""
    config = replace(config, epochs=1)
    generator = torch.Generator().manual_seed(0)
    network = MindMeld(NetworkConfig(), generator)
    people = len(windows.people)
    count = people * (2 if config.mirror else 1)
    embeddings = torch.randn(count, 4, generator=generator).requires_grad_()
    rows = torch.nonzero(windows.valid).squeeze(1)
    optimizer = torch.optim.Adam(
        [
            {"params": list(network.parameters()), "lr": config.rate},
            {"params": [embeddings], "lr": config.rate * config.embedding_rate_factor},
        ]
    )
    drawn = rows[torch.randperm(len(rows), generator=generator)]
    batches = drawn[: round(config.share_per_epoch * len(rows))].split(config.batch_size)
    initial = [group["lr"] for group in optimizer.param_groups]
    losses = torch.zeros(2)
    for number, batch in enumerate(batches):
        mirrored = torch.zeros(len(batch), dtype=torch.bool)
        if config.mirror:
            mirrored = torch.rand(len(batch), generator=generator) < 0.5
        inputs, sign = windows.inputs[batch].clone(), 1.0 - 2.0 * mirrored
        inputs[:, :, 0] *= sign[:, None]
        loss = mind_meld_loss(
            network,
            inputs,
            sign * windows.difference[batch],
            embeddings[windows.person[batch] + people * mirrored],
            config.embedding_loss_weight,
            generator,
            config.huber,
        )
        factor = 0.5 * (1.0 + np.cos(np.pi * number / len(batches))) if config.cosine else 1.0
        for group, rate in zip(optimizer.param_groups, initial, strict=True):
            group["lr"] = rate * factor
        optimizer.zero_grad()
        loss.total.backward()
        optimizer.step()
        losses += torch.stack([loss.difference, loss.embedding]).detach()

    found = train(windows, NetworkConfig(), config, 0)
    assert found.history[0] == pytest.approx((losses / len(batches)).tolist(), rel=1e-4)
    # Adam divides by the gradient's size, so where that is nearly 0 last bits become whole steps.
    close = (found.embeddings - embeddings[:people]).abs() < 1e-3
    assert close.float().mean() > 0.95
    for ours, plain in zip(found.network.parameters(), network.parameters(), strict=True):
        assert ((ours - plain).abs() < 1e-3).float().mean() > 0.95


def test_threads_are_set_and_given_back():
    before = torch.get_num_threads()
    with torch_threads(before + 1):
        assert torch.get_num_threads() == before + 1
    assert torch.get_num_threads() == before


def test_the_loss_falls_and_progress_is_told(windows):
    told: list[tuple[int, int]] = []
    result = train(
        windows,
        NetworkConfig(),
        replace(SHORT, epochs=6),
        0,
        on_epoch=lambda done, of: told.append((done, of)),
    )
    assert told == [(done, 6) for done in range(1, 7)]
    assert result.history[-1][0] < 0.6 * result.history[0][0]


def test_masked_steps_never_train(study):
    """Whatever stands at a masked step's truth, the trained bits are the same."""
    series = study.train_seen[:4]
    rng = np.random.default_rng(0)
    masked, scrambled = [], []
    for one in series:
        valid = rng.random(one.steps) < 0.7
        masked.append(replace(one, valid=valid, truth=np.where(valid, one.truth, np.nan)))
        scrambled.append(replace(one, valid=valid, truth=np.where(valid, one.truth, 2.0)))
    first = trained_bits(make_windows(masked, WindowConfig()), 1)
    second = trained_bits(make_windows(scrambled, WindowConfig()), 1)
    assert all(torch.isfinite(one).all() for one in first)
    assert all(torch.equal(one, two) for one, two in zip(first, second, strict=True))


def test_someone_without_a_valid_label_is_named(study):
    one, two = study.train_seen[0], study.train_seen[-1]
    blank = replace(two, valid=np.zeros(two.steps, dtype=bool))
    with pytest.raises(InvalidLabels, match=two.person):
        train(make_windows([one, blank], WindowConfig()), NetworkConfig(), SHORT, 0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("epochs", 0),
        ("rate", float("nan")),
        ("share_per_epoch", 1.5),
        ("embedding_loss_weight", -1),
    ],
)
def test_impossible_settings_are_refused(name, value):
    with pytest.raises(InvalidConfig, match=name):
        TrainingConfig(**{name: value})


def test_as_the_authors_code_does_it_w_starts_within_0_and_1_and_is_not_sampled(windows):
    still = replace(SHORT, epochs=1, rate=1e-9, mirror=False, uniform_start=True)
    w = train(windows, NetworkConfig(embedding_size=2), still, 0).embeddings
    assert 0.0 <= w.min() < 0.3 < 0.7 < w.max() <= 1.0
    network = MindMeld(NetworkConfig(), torch.Generator().manual_seed(0))
    row = torch.arange(8)
    losses = {
        (sampled, seed): mind_meld_loss(
            network,
            windows.inputs[row],
            windows.difference[row],
            torch.zeros(8, 4),
            0.01,
            torch.Generator().manual_seed(seed),
            sampled=sampled,
        ).embedding.item()
        for sampled in (False, True)
        for seed in (1, 2)
    }
    assert losses[False, 1] == losses[False, 2]
    assert losses[True, 1] != losses[True, 2]
