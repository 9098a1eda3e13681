"""A new person's embedding with the network frozen: Levenberg-Marquardt over all people at once."""

from dataclasses import dataclass

import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.windows import Windows

_CHUNK = 4096  # rows of activations held at once; they stay in the cache


@dataclass(frozen=True, kw_only=True)
class CalibrationConfig:
    """When to stop and how to damp (Nocedal & Wright, *Numerical Optimization*, section 10.3)."""

    iterations: int = 15
    tolerance: float = 1e-3  # stop when no embedding moves further than this
    damping: float = 1e-2
    accepted_factor: float = 0.3
    rejected_factor: float = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class _NormalEquations:
    """Sums over each person's windows: loss (people,), gradient (people, d), matrix (.., d, d)."""

    loss: Tensor
    gradient: Tensor
    matrix: Tensor


def calibrate(
    network: MindMeld,
    windows: Windows,
    start: Tensor,
    embedding_loss_weight: float,
    config: CalibrationConfig | None = None,
) -> Tensor:
    """Fit w of each person to Eq. 2, the network frozen (paper, Algorithm 1).

    Departures from the paper: Levenberg-Marquardt instead of gradient steps (Adam at the paper's
    rate recovers 8 % in 80 steps), and g's mean instead of a sample, which makes the loss a sum of
    squares without randomness.

    Args:
        network: trained; it is not changed.
        windows: calibration windows of one or more people; only valid rows count.
        start: (d,), the mean embedding of the training people.
        embedding_loss_weight: lambda, as in training.
        config: when to stop; the defaults serve.

    Returns:
        (people, d) in the order of ``windows.people``.

    Raises:
        InvalidLabels: someone has no valid window.
    """
    config = config or CalibrationConfig()
    rows = torch.nonzero(windows.valid).squeeze(1)
    person, people = windows.person[rows], len(windows.people)
    counts = torch.bincount(person, minlength=people)
    for name, count in zip(windows.people, counts.tolist(), strict=True):
        if count == 0:
            raise InvalidLabels(f"{name!r} has no valid label to calibrate on; label a rollout.")
    with torch.no_grad():
        encoding = encode(network, windows.inputs[rows])
        difference = windows.difference[rows]

        def equations(embeddings: Tensor) -> _NormalEquations:
            return _normal_equations(
                network, encoding, difference, person, embeddings, embedding_loss_weight
            )

        embeddings = start.repeat(people, 1)
        damping = torch.full((people,), config.damping, dtype=torch.float64)
        current = equations(embeddings)
        for _ in range(config.iterations):
            step = _damped_step(current, damping)
            candidate = embeddings - step.to(embeddings.dtype)
            tried = equations(candidate)
            better = tried.loss < current.loss
            embeddings = torch.where(better[:, None], candidate, embeddings)
            current = _NormalEquations(
                torch.where(better, tried.loss, current.loss),
                torch.where(better[:, None], tried.gradient, current.gradient),
                torch.where(better[:, None, None], tried.matrix, current.matrix),
            )
            damping *= torch.where(better, config.accepted_factor, config.rejected_factor)
            if float(step.abs().max()) < config.tolerance:
                break
    return embeddings


def encode(network: MindMeld, inputs: Tensor) -> Tensor:
    """Encode many windows, a chunk at a time: (rows, window, channels) -> (rows, k)."""
    with torch.no_grad():
        return torch.cat([network.encoder(chunk) for chunk in inputs.split(_CHUNK)])


def _damped_step(equations: _NormalEquations, damping: Tensor) -> Tensor:
    diagonal = equations.matrix.diagonal(dim1=1, dim2=2)
    floor = 1e-9 * diagonal.amax(dim=1, keepdim=True) + 1e-12  # a direction nothing depends on
    damped = equations.matrix + torch.diag_embed(damping[:, None] * diagonal + floor)
    return torch.linalg.solve(damped, equations.gradient)


def _normal_equations(
    network: MindMeld,
    encoding: Tensor,
    difference: Tensor,
    person: Tensor,
    embeddings: Tensor,
    weight: float,
) -> _NormalEquations:
    people, size = embeddings.shape
    loss = torch.zeros(people, dtype=torch.float64)
    gradient = torch.zeros(people, size, dtype=torch.float64)
    matrix = torch.zeros(people, size, size, dtype=torch.float64)
    identity = torch.eye(size)
    for chunk in torch.arange(len(person)).split(_CHUNK):
        z, owner = encoding[chunk], person[chunk]
        w = embeddings[owner]
        predicted, by_w = network.difference.with_jacobian(z, w)
        residual = (predicted - difference[chunk])[:, None]  # (rows, 1)
        jacobian = by_w[:, None, :]  # (rows, 1, d)
        if weight > 0.0:
            mean, mean_by_difference = network.inference.mean_with_derivative(z, predicted)
            scale = (weight / size) ** 0.5
            residual = torch.cat([residual, scale * (mean - w)], dim=1)
            by_w_of_mean = mean_by_difference[:, :, None] * by_w[:, None, :] - identity
            jacobian = torch.cat([jacobian, scale * by_w_of_mean], dim=1)
        loss.index_add_(0, owner, residual.square().sum(1).double())
        gradient.index_add_(0, owner, torch.einsum("nrd,nr->nd", jacobian, residual).double())
        matrix.index_add_(0, owner, torch.einsum("nrd,nre->nde", jacobian, jacobian).double())
    return _NormalEquations(loss, gradient, matrix)
