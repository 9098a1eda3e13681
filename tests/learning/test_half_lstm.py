import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from steerlab.learning.half_lstm import LANES, last_hidden
from steerlab.learning.training import torch_threads


def pair_of(units: int, seed: int) -> tuple[nn.LSTM, nn.LSTM]:
    return lstm_of(units, seed), lstm_of(units, seed + 1000)


def lstm_of(units: int, seed: int) -> nn.LSTM:
    lstm, generator = nn.LSTM(2, units), torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in lstm.parameters():
            parameter.uniform_(-1.0, 1.0, generator=generator)  # so that gates open and close
    return lstm


@settings(deadline=None, max_examples=25)
@given(
    units=st.sampled_from([4, 8, 32]),
    batch=st.sampled_from([0, 1, 2, 77, LANES - 1, LANES, LANES + 1, 300]),
    steps=st.integers(1, 16),
    seed=st.integers(0, 2**31),
)
def test_state_and_gradient_are_torchs(units, batch, steps, seed):
    lstms, generator = pair_of(units, seed % 7), torch.Generator().manual_seed(seed)
    halves = [2.5 * torch.randn(steps, batch, 2, generator=generator) for _ in lstms]
    by = torch.randn(batch, 2 * units, generator=generator)
    weights = [one for lstm in lstms for one in lstm.parameters()]
    got = last_hidden(lstms, *halves)
    slopes = torch.autograd.grad(got, weights, by)
    for lstm in lstms:
        lstm.double()
    with torch_threads(1):
        if batch:
            last = [
                lstm(samples.double())[1][0][0] for lstm, samples in zip(lstms, halves, strict=True)
            ]
            expected = torch.cat(last, dim=1)
            weights = [one for lstm in lstms for one in lstm.parameters()]
            by_torch = torch.autograd.grad(expected, weights, by.double())
        else:
            expected = torch.zeros(0, 2 * units)
            by_torch = [torch.zeros_like(one) for one in weights]
    torch.testing.assert_close(got.double(), expected.double(), atol=2e-6, rtol=0)
    for slope, other in zip(slopes, by_torch, strict=True):
        scale = float(other.abs().max()) if other.numel() else 0.0
        torch.testing.assert_close(slope.double(), other.double(), atol=1e-5 * scale + 1e-6, rtol=0)


def test_views_are_taken_and_nan_shows():
    lstms = pair_of(8, 0)
    wide = torch.randn(40, 21, 3, generator=torch.Generator().manual_seed(0))
    view = wide.transpose(0, 1)[::2, :, 1:]
    assert torch.equal(
        last_hidden(lstms, view, view), last_hidden(lstms, view.clone(), view.clone())
    )
    with torch.no_grad():
        next(lstms[1].parameters())[3, 1] = float("nan")
    past, future = last_hidden(lstms, view, view).chunk(2, dim=1)
    assert future.isnan().any()
    assert not past.isnan().any()


def test_a_windows_state_depends_on_no_other():
    lstms = pair_of(32, 0)
    samples = torch.randn(11, 300, 2, generator=torch.Generator().manual_seed(0))
    one = samples[:, 137:138]
    together = last_hidden(lstms, samples, samples.flip(0))
    assert torch.equal(last_hidden(lstms, one, one.flip(0)), together[137:138])


@pytest.mark.parametrize("units", [3, 33])
def test_sizes_that_it_does_not_take_are_torchs_own(units):
    from steerlab.learning.mind_meld import NetworkConfig, WindowEncoder

    encoder = WindowEncoder(NetworkConfig(lstm_size=units))
    inputs = torch.randn(5, 21, 2, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        expected = encoder(inputs)
    torch.testing.assert_close(encoder(inputs), expected)
