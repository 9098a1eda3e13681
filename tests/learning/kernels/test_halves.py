import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.kernels.halves import encode_windows
from steerlab.learning.kernels.lanes import LANES
from steerlab.learning.kernels.one_window import OneWindow
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.training import torch_threads
from steerlab.sim.errors import InvalidConfig

CONFIGS = st.builds(
    NetworkConfig,
    lstm_size=st.sampled_from([1, 2, 3, 8, 32, 33]),
    encoding_size=st.sampled_from([1, 5, 16]),
    embedding_size=st.sampled_from([1, 2, 4, 5]),
)
BATCHES = st.sampled_from([0, 1, 2, 77, LANES - 1, LANES, LANES + 1, 300])


def network(config: NetworkConfig, seed: int) -> MindMeld:
    made = MindMeld(config, torch.Generator().manual_seed(seed)).requires_grad_(False)
    for parameter in made.parameters():
        parameter *= 2.0  # so that gates open and close
    return made


@settings(deadline=None, max_examples=25)
@given(config=CONFIGS, batch=BATCHES, length=st.integers(1, 31), seed=st.integers(0, 2**31))
def test_the_encoding_is_that_of_a_bidirectional_lstm(config, batch, length, seed):
    net = network(config, seed % 7)
    inputs = 2.5 * torch.randn(batch, length, 2, generator=torch.Generator().manual_seed(seed))
    with torch_threads(1):
        states, _ = net.encoder.bidirectional()(inputs)
    expected = net.encoder.to_encoding(states[:, length // 2])
    torch.testing.assert_close(encode_windows(net, inputs), expected, atol=1e-5, rtol=0)


def test_a_windows_encoding_depends_on_no_other_and_on_no_place():
    net = network(NetworkConfig(), 0)
    inputs = torch.randn(300, 21, 2, generator=torch.Generator().manual_seed(0))
    order = torch.randperm(300, generator=torch.Generator().manual_seed(1))
    together = encode_windows(net, inputs)
    assert torch.equal(encode_windows(net, inputs[order]), together[order])
    assert torch.equal(encode_windows(net, inputs[137:138]), together[137:138])


def test_inputs_may_be_views():
    net = network(NetworkConfig(), 0)
    wide = torch.randn(21, 40, 3, generator=torch.Generator().manual_seed(0))
    view = wide.transpose(0, 1)[::2, :, 1:]
    assert not view.is_contiguous()
    assert torch.equal(encode_windows(net, view), encode_windows(net, view.clone()))


def test_only_float32_is_taken():
    net = network(NetworkConfig(), 0)
    with pytest.raises(InvalidConfig, match="float64"):
        encode_windows(net, torch.zeros(3, 21, 2, dtype=torch.float64))
    with pytest.raises(InvalidConfig, match="float64"):
        encode_windows(net.double(), torch.zeros(3, 21, 2))


@settings(deadline=None, max_examples=25)
@given(config=CONFIGS, length=st.integers(1, 31), seed=st.integers(0, 2**31))
def test_one_window_is_what_the_network_says(config, length, seed):
    net, generator = network(config, seed % 7), torch.Generator().manual_seed(seed)
    window = 2.5 * torch.randn(length, 2, generator=generator)
    embedding = torch.randn(config.embedding_size, generator=generator)
    expected = net.difference(net.encoder(window[None]), embedding[None]).item()
    got = OneWindow(net, embedding).difference(window.numpy())
    assert got == pytest.approx(expected, abs=1e-5, rel=1e-5)
