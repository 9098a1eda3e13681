import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from steerlab.learning.kernels.heads import Loss
from steerlab.learning.kernels.lanes import LANES
from steerlab.learning.kernels.step import Batch, BatchGradient
from steerlab.learning.kernels.weights import pack, unpack
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.training import mind_meld_loss, torch_threads

PEOPLE, WINDOWS, WEIGHT = 5, 400, 0.1
SMALL = NetworkConfig(
    embedding_size=3, lstm_size=6, encoding_size=5, difference_hidden=7, inference_hidden=(9, 3)
)
TWO = NetworkConfig(embedding_size=2, lstm_size=2, encoding_size=1, difference_hidden=1)


class Case:
    """A random batch, of which both the kernels and torch can be asked."""

    def __init__(
        self, config: NetworkConfig, count: int, length: int, huber: float | None, seed: int
    ) -> None:
        generator = torch.Generator().manual_seed(seed)
        self.network, self.huber, self.seed = MindMeld(config, generator), huber, seed
        with torch.no_grad():
            for parameter in self.network.parameters():
                parameter *= 1.5
        self.inputs = torch.randn(WINDOWS, length, 2, generator=generator)
        self.row = torch.randint(WINDOWS, (count,), generator=generator)
        self.sign = 1.0 - 2.0 * torch.randint(2, (count,), generator=generator)
        self.target = torch.randn(count, generator=generator)
        self.person = torch.randint(PEOPLE, (count,), generator=generator)
        self.embeddings = torch.randn(PEOPLE, config.embedding_size, generator=generator)
        self.noise = torch.randn(
            count, config.embedding_size, generator=torch.Generator().manual_seed(seed)
        )

    def by_kernel(self, threads: int = 1) -> tuple[Tensor, Tensor, Tensor]:
        batch = Batch.of(self.inputs, self.row, self.sign, self.target, self.person, self.noise)
        loss, length = Loss.of(WEIGHT, self.huber), self.inputs.shape[1]
        with BatchGradient(self.network, loss, length, threads) as gradient:
            return gradient(batch, self.embeddings, pack(self.network))

    def by_autograd(self) -> tuple[list[Tensor], Tensor, Tensor]:
        """In float64: gradients by each parameter, by each window's embedding, both losses."""
        network = self.network.double()
        inputs = self.inputs[self.row].double()
        inputs[:, :, 0] *= self.sign[:, None]
        own = self.embeddings[self.person].double().requires_grad_()
        with torch_threads(1):
            loss = mind_meld_loss(
                network,
                inputs,
                self.target.double(),
                own,
                WEIGHT,
                torch.Generator().manual_seed(self.seed),
                self.huber,
            )
            gradients = torch.autograd.grad(loss.total, [*network.parameters(), own])
        network.float()
        return list(gradients[:-1]), gradients[-1], torch.stack([loss.difference, loss.embedding])


def assert_same(case: Case, threads: int = 1) -> None:
    by_vector, by_embedding, losses = case.by_kernel(threads)
    by_parameter, by_own, expected_losses = case.by_autograd()
    unpack(by_vector, case.network)  # so that padding is stripped
    for (name, got), expected in zip(case.network.named_parameters(), by_parameter, strict=True):
        scale = expected.abs().max().item()
        torch.testing.assert_close(
            got.double(),
            expected,
            atol=1e-4 * scale + 1e-7,
            rtol=0,
            msg=lambda text, name=name: f"{name}: {text}",
        )
    scale = by_own.abs().max().item()
    torch.testing.assert_close(by_embedding.double(), by_own, atol=1e-4 * scale, rtol=0)
    torch.testing.assert_close(losses.double(), expected_losses, atol=1e-6, rtol=1e-5)


@settings(deadline=None, max_examples=25)
@given(
    config=st.sampled_from([NetworkConfig(), NetworkConfig(embedding_size=2), SMALL, TWO]),
    count=st.sampled_from([1, 2, 63, LANES - 1, LANES, LANES + 1, 300]),
    length=st.integers(1, 25),
    huber=st.sampled_from([None, 0.3, 1.0]),
    seed=st.integers(0, 2**31),
)
def test_losses_and_gradient_are_autograds(config, count, length, huber, seed):
    assert_same(Case(config, count, length, huber, seed))


def test_log_sigma_is_clamped_with_no_gradient_beyond():
    case = Case(NetworkConfig(), 200, 21, None, 0)
    last = case.network.inference.layers[4]
    with torch.no_grad():
        last.weight[4:] *= 20.0
        last.bias[4:] += torch.tensor([-5.0, 2.0, 0.0, -1.0])
    assert_same(case)


def test_the_gradient_is_the_slope_of_the_loss():
    """Down a random direction, by central differences of the kernel's own loss."""
    case = Case(NetworkConfig(), 300, 21, 0.3, 1)
    by_vector, _, _ = case.by_kernel()
    vector = pack(case.network)
    direction = by_vector / by_vector.norm()
    losses: list[float] = []
    for step in (1e-2, -1e-2):
        unpack(vector + step * direction, case.network)
        difference, embedding = case.by_kernel()[2].tolist()
        losses.append(difference + WEIGHT * embedding)
    slope = (losses[0] - losses[1]) / 2e-2
    assert slope == pytest.approx(by_vector.norm().item(), rel=1e-2)


@pytest.mark.parametrize("count", [1, 130, 512])
def test_threads_change_no_bit(count: int):
    case = Case(NetworkConfig(), count, 21, 0.3, 2)
    once = case.by_kernel(1)
    for threads in (1, 2, 3, 7):
        again = case.by_kernel(threads)
        assert all(torch.equal(one, two) for one, two in zip(once, again, strict=True))


def test_of_no_window_everything_is_zero():
    by_vector, by_embedding, losses = Case(NetworkConfig(), 0, 21, None, 3).by_kernel()
    assert not by_vector.any()
    assert by_embedding.shape == (0, 4)
    assert losses.tolist() == [0.0, 0.0]


def test_padding_has_no_gradient_so_an_optimiser_leaves_it_at_zero():
    case = Case(SMALL, 200, 21, None, 4)
    vector = pack(case.network)
    by_vector, _, _ = case.by_kernel()
    with torch.no_grad():
        for parameter in case.network.parameters():
            parameter.fill_(1.0)
    padding = pack(case.network) == 0.0
    assert padding.any()
    assert not vector[padding].any()
    assert not by_vector[padding].any()


def test_a_diverged_network_shows():
    case = Case(NetworkConfig(), 200, 21, 0.3, 5)
    with torch.no_grad():
        case.network.encoder.forward_lstm.weight_hh_l0[3, 4] = np.nan
    by_vector, _, losses = case.by_kernel()
    assert losses.isnan().all()
    assert by_vector.isnan().any()


@pytest.mark.parametrize("config", [NetworkConfig(), SMALL, TWO])
def test_packing_loses_nothing(config: NetworkConfig):
    one = MindMeld(config, torch.Generator().manual_seed(0))
    other = MindMeld(config, torch.Generator().manual_seed(1))
    unpack(pack(one), other)
    assert all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))
