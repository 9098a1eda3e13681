import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.training import mind_meld_loss
from steerlab.sim.errors import InvalidConfig


def network(seed: int = 0) -> MindMeld:
    return MindMeld(NetworkConfig(), torch.Generator().manual_seed(seed))


@settings(deadline=None, max_examples=20)
@given(side=st.integers(1, 15), batch=st.integers(1, 9), seed=st.integers(0, 2**31))
def test_half_windows_equal_a_full_bidirectional_pass(side: int, batch: int, seed: int):
    encoder = network(seed % 7).encoder
    inputs = torch.randn(batch, 2 * side + 1, 2, generator=torch.Generator().manual_seed(seed))
    states, _ = encoder.bidirectional()(inputs)
    full = encoder.to_encoding(states[:, side])
    torch.testing.assert_close(encoder(inputs), full, atol=2e-6, rtol=0)


def test_the_paper_sizes():
    net = network()
    assert net.encoder.forward_lstm.hidden_size == 32
    assert net.difference.hidden.out_features == 200
    widths = [layer.out_features for layer in net.inference.layers if hasattr(layer, "weight")]
    assert widths == [64, 32, 8]


def test_the_loss_has_the_parts_of_eq_2_and_reaches_w_through_both():
    net, generator = network(), torch.Generator().manual_seed(1)
    inputs, difference = torch.randn(8, 21, 2, generator=generator), torch.zeros(8)
    w = torch.randn(8, 4, generator=generator).requires_grad_()
    loss = mind_meld_loss(net, inputs, difference, w, 0.25, generator)
    assert loss.total.item() == pytest.approx(
        loss.difference.item() + 0.25 * loss.embedding.item(), rel=1e-6
    )
    for part in (loss.difference, loss.embedding):
        (gradient,) = torch.autograd.grad(part, w, retain_graph=True)
        assert gradient.abs().max() > 0.0


def test_weights_come_from_the_generator_alone():
    before = torch.random.get_rng_state()
    first, second, other = network(3), network(3), network(4)
    assert torch.equal(torch.random.get_rng_state(), before)
    for one, same, different in zip(
        first.parameters(), second.parameters(), other.parameters(), strict=True
    ):
        assert torch.equal(one, same)
        assert not torch.equal(one, different)


def test_impossible_sizes_are_refused():
    with pytest.raises(InvalidConfig, match="below 1"):
        NetworkConfig(embedding_size=0)
