"""Gauss-Newton's sums over each person's windows: what calibration solves for w."""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

from steerlab.learning.mind_meld import LOG_SIGMA_RANGE, MindMeld


class Sums(NamedTuple):
    """Over each person's windows, float64.

    Attributes:
        loss: (people,), of squared residuals.
        gradient: (people, d), J'r: half the loss's derivative by w.
        matrix: (people, d, d), J'J.
        sigma_square: (people, d), of g.
    """

    loss: Tensor
    gradient: Tensor
    matrix: Tensor
    sigma_square: Tensor


class PeopleWindows(NamedTuple):
    """Everyone's windows side by side; people with fewer are padded with absent windows.

    Attributes:
        encoding: (people, most, k).
        before_w: (people, most, hidden), what f's hidden layer adds to what w gives it.
        difference: (people, most), the true ``a - o``.
        there: (people, most), 1 or 0.
    """

    encoding: Tensor
    before_w: Tensor
    difference: Tensor
    there: Tensor

    @classmethod
    def of(
        cls,
        network: MindMeld,
        encoding: Tensor,
        difference: Tensor,
        counts: Tensor,
        strides: Tensor,
    ) -> "PeopleWindows":
        """Pad everyone's windows to one length.

        Args:
            network: frozen.
            encoding: (windows, k), one person's after another's.
            difference: (windows,).
            counts: (people,), each at least 1.
            strides: (people,), every ``stride``-th of a person's windows is taken.
        """
        sizes, steps = counts.tolist(), strides.tolist()

        def beside(values: Tensor) -> Tensor:
            people = zip(values.split(sizes), steps, strict=True)
            return pad_sequence([rows[::step] for rows, step in people], batch_first=True)

        laid, hidden = beside(encoding), network.difference.hidden
        before_w = laid @ hidden.weight[:, : laid.shape[2]].T + hidden.bias
        return cls(laid, before_w, beside(difference), beside(torch.ones_like(difference)))


def normal_equations(
    network: MindMeld, windows: PeopleWindows, embeddings: Tensor, weight: float
) -> tuple[Sums, Tensor]:
    """Both terms of Eq. 2 as least squares in w, g's mean in place of a sample.

    With b the derivative of f by w, g's mean m and its derivative s by the difference, a window's
    second residual is ``m - w`` and its derivative ``s b' - I``.

    Args:
        network: frozen.
        windows: of everyone.
        embeddings: (people, d).
        weight: lambda.

    Returns:
        the sums, and the residuals of the difference, (people, most); 0 where there is no window.
    """
    size, there = embeddings.shape[1], windows.there[:, :, None]
    predicted, by_w = _difference(network, windows, embeddings)
    mean, by_difference, sigma = _inference(network, windows.encoding, predicted)
    residual = (predicted - windows.difference) * windows.there
    scale = (weight / size) ** 0.5
    away = scale * there * (mean - embeddings[:, None])
    slope = scale * there * by_difference
    by_w = there * by_w
    # J'r and J'J of all residuals, from b, s and I.
    pull = residual + (slope * away).sum(2)
    curvature = 1.0 + slope.square().sum(2)
    crossed = scale * (slope.transpose(1, 2) @ by_w).double()
    matrix = (by_w.transpose(1, 2) @ (curvature[:, :, None] * by_w)).double()
    counts = windows.there.double().sum(1)
    identity = torch.eye(size, dtype=torch.float64)
    return (
        Sums(
            loss=residual.double().square().sum(1) + away.double().square().sum((1, 2)),
            gradient=(by_w * pull[:, :, None]).double().sum(1) - scale * away.double().sum(1),
            matrix=matrix
            - crossed
            - crossed.transpose(1, 2)
            + scale**2 * counts[:, None, None] * identity,
            sigma_square=(there * sigma.square()).sum(1).double(),
        ),
        residual,
    )


def _difference(
    network: MindMeld, windows: PeopleWindows, embeddings: Tensor
) -> tuple[Tensor, Tensor]:
    """f, (people, most), and its derivative by w, (people, most, d)."""
    f, by_embedding = (
        network.difference,
        network.difference.hidden.weight[:, -embeddings.shape[1] :],
    )
    hidden = (windows.before_w + (embeddings @ by_embedding.T)[:, None]).relu_()
    predicted = f.out(hidden).squeeze(2)
    on = hidden.sign_()  # 1 or 0, as nothing is below 0
    return predicted, on @ (f.out.weight.T * by_embedding)


def _inference(
    network: MindMeld, encoding: Tensor, difference: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Mean of g, its derivative by the difference, and sigma, (people, most, d) each."""
    value = torch.cat([encoding, difference[:, :, None]], dim=2)
    slope = torch.zeros(value.shape[2])
    slope[-1] = 1.0
    for layer in network.inference.layers:
        if isinstance(layer, nn.Linear):
            value, slope = layer(value), slope @ layer.weight.T
        else:
            value = value.relu()
            slope = slope * value.sign()
    mean, log_sigma = value.chunk(2, 2)
    return mean, slope.chunk(2, 2)[0], log_sigma.clamp(*LOG_SIGMA_RANGE).exp()
