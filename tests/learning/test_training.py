from dataclasses import replace

import numpy as np
import pytest
import torch

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import NetworkConfig
from steerlab.learning.training import TrainingConfig, torch_threads, train
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.errors import InvalidConfig

SHORT = TrainingConfig(epochs=3, batch_size=128, share_per_epoch=0.1, least_per_epoch=1)


@pytest.fixture(scope="module", name="windows")
def _windows(study):
    return make_windows(study.train_seen[:12], WindowConfig())


def trained_bits(windows, seed: int) -> list[torch.Tensor]:
    result = train(windows, NetworkConfig(), SHORT, seed)
    return [result.embeddings, *result.network.state_dict().values()]


def test_same_seed_same_bits_and_no_global_state(windows):
    before = torch.random.get_rng_state()
    first = trained_bits(windows, 7)
    torch.manual_seed(123)
    second, other = trained_bits(windows, 7), trained_bits(windows, 8)
    assert all(torch.equal(one, two) for one, two in zip(first, second, strict=True))
    assert not torch.equal(first[0], other[0])
    torch.random.set_rng_state(before)


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
