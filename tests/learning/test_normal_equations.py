import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.func import jacrev, vmap

from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.normal_equations import PeopleWindows, normal_equations
from steerlab.learning.training import torch_threads

SMALL = NetworkConfig(
    embedding_size=3, lstm_size=6, encoding_size=5, difference_hidden=7, inference_hidden=(9, 3)
)


def residuals(net: MindMeld, z: Tensor, difference: Tensor, w: Tensor, weight: float) -> Tensor:
    """Both terms of Eq. 2 for one window and w, (1 + d,), g's mean in place of a sample."""
    predicted = net.difference(z[None], w[None])
    mean, _ = net.inference(z[None], predicted)
    scale = (weight / len(w)) ** 0.5
    return torch.cat([predicted - difference, scale * (mean[0] - w)])


@settings(deadline=None, max_examples=25)
@given(
    config=st.sampled_from([NetworkConfig(), NetworkConfig(embedding_size=1), SMALL]),
    counts=st.lists(st.integers(1, 300), min_size=1, max_size=4),
    weight=st.sampled_from([0.0, 0.1, 1.0]),
    stride=st.integers(1, 5),
    seed=st.integers(0, 2**31),
)
def test_the_sums_are_those_of_autograds_jacobian(config, counts, weight, stride, seed):
    generator = torch.Generator().manual_seed(seed)
    net = MindMeld(config, generator).requires_grad_(False)
    rows = sum(counts)
    z = torch.randn(rows, config.encoding_size, generator=generator)
    difference = torch.randn(rows, generator=generator)
    w = torch.randn(len(counts), config.embedding_size, generator=generator)
    strides = torch.tensor([stride if index % 2 else 1 for index in range(len(counts))])

    windows = PeopleWindows.of(net, z, difference, torch.tensor(counts), strides)
    sums, residual = normal_equations(net, windows, w, weight)

    net.double()
    start = 0
    for person, count in enumerate(counts):
        read = slice(start, start + count, int(strides[person]))
        own_z, own_d = z[read].double(), difference[read].double()
        own_w = w[person].double().expand(len(own_z), -1)

        def of(z: Tensor, d: Tensor, w: Tensor) -> Tensor:
            return residuals(net, z, d, w, weight)

        with torch_threads(1):
            r = vmap(of)(own_z, own_d, own_w)
            jacobian = vmap(jacrev(of, argnums=2))(own_z, own_d, own_w)
        _, log_sigma = net.inference(own_z, r[:, 0] + own_d)
        for got, expected in (
            (sums.loss[person], r.square().sum()),
            (sums.gradient[person], torch.einsum("nrd,nr->d", jacobian, r)),
            (sums.matrix[person], torch.einsum("nri,nrj->ij", jacobian, jacobian)),
            (sums.sigma_square[person], (2.0 * log_sigma).exp().sum(0)),
        ):
            torch.testing.assert_close(got, expected, rtol=1e-4, atol=1e-4 * len(own_z) ** 0.5)
        own = residual[person]
        torch.testing.assert_close(own[: len(r)].double(), r[:, 0], rtol=1e-5, atol=1e-5)
        assert not own[len(r) :].any()
        start += count


def test_people_touch_each_other_by_rounding_alone():
    generator = torch.Generator().manual_seed(0)
    net = MindMeld(NetworkConfig(), generator).requires_grad_(False)
    z, difference = torch.randn(500, 16, generator=generator), torch.randn(500, generator=generator)
    w, counts = torch.randn(2, 4, generator=generator), torch.tensor([200, 300])
    ones = torch.ones_like(counts)
    both, _ = normal_equations(net, PeopleWindows.of(net, z, difference, counts, ones), w, 0.1)
    second = PeopleWindows.of(net, z[200:], difference[200:], counts[1:], ones[1:])
    alone, _ = normal_equations(net, second, w[1:], 0.1)
    for one, other in zip(both, alone, strict=True):
        torch.testing.assert_close(one[1:], other, rtol=1e-5, atol=1e-4)
