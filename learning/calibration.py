"""A new person's embedding with the network frozen: Levenberg-Marquardt over many at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.series import LabelSeries
from steerlab.learning.windows import Windows

_CHUNK = 1024  # windows encoded at once; their activations stay in the cache
_ROWS = 4096  # windows of the people who are fitted together
_COARSE = 4  # the first steps need only every fourth window


@dataclass(frozen=True, kw_only=True)
class CalibrationConfig:
    """When to stop and how to damp (Nocedal & Wright, *Numerical Optimization*, section 10.3)."""

    iterations: int = 15
    tolerance: float = 3e-4  # stop when no step promises to lower the loss by this share of it
    coarse_iterations: int = 6  # before, on every fourth window: cheap, and nearly there
    damping: float = 1e-2
    accepted_factor: float = 0.3
    rejected_factor: float = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedPeople:
    """What calibration found, in the order of ``Windows.people``.

    Attributes:
        embeddings: (people, d), w.
        information: (people, d, d), how sharply the labels determine w: the Gauss-Newton matrix
            over the residual variance, corrected for windows that repeat each other.
        g_sigma: (people, d), root mean square of g's sigma: how sure a single window is.
    """

    embeddings: Tensor
    information: Tensor
    g_sigma: Tensor


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """A few people's windows, padded to equally many; what does not depend on w is done once.

    Attributes:
        encoding: (people, rows, k).
        for_f, for_g: what z adds to the first layers of f and g.
        difference: (people, rows).
        counts: (people, rows), 1 for a window and 0 for padding.
    """

    encoding: Tensor
    for_f: Tensor
    for_g: Tensor
    difference: Tensor
    counts: Tensor

    def every(self, stride: int) -> "_Rows":
        """Every ``stride``-th window; all of them for people with few."""
        if stride == 1 or self.counts.shape[1] < 100 * stride:
            return self
        return _Rows(*(getattr(self, name)[:, ::stride].contiguous() for name in self.__slots__))


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
) -> CalibratedPeople:
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

    Raises:
        InvalidLabels: someone has no valid window.
    """
    config = config or CalibrationConfig()
    found: list[CalibratedPeople] = []
    with torch.no_grad():
        for rows in _groups(network, windows):
            embeddings = _fit(network, rows, start, embedding_loss_weight, config)
            information, g_sigma = _certainty(network, rows, embeddings)
            found.append(CalibratedPeople(embeddings, information, g_sigma))
    return CalibratedPeople(
        torch.cat([one.embeddings for one in found]),
        torch.cat([one.information for one in found]),
        torch.cat([one.g_sigma for one in found]),
    )


def encode(network: MindMeld, inputs: Tensor) -> Tensor:
    """Encode many windows, a chunk at a time: (rows, window, channels) -> (rows, k)."""
    with torch.no_grad():
        return torch.cat([network.encoder(chunk) for chunk in inputs.split(_CHUNK)])


def spread_rows(series: Sequence[LabelSeries], most: int) -> npt.NDArray[np.int64]:
    """At most ``most`` valid steps of each person, evenly spread, counted through all series."""
    valid = np.flatnonzero(np.concatenate([one.valid for one in series]))
    steps = [one.steps for one in series]
    person = np.repeat([one.person for one in series], steps)[valid]
    chosen: list[npt.NDArray[np.int64]] = []
    for name in dict.fromkeys(one.person for one in series):
        own = valid[person == name]
        if len(own) > most:
            own = own[np.linspace(0, len(own) - 1, most).round().astype(np.int64)]
        chosen.append(own)
    return np.sort(np.concatenate(chosen))


def _groups(network: MindMeld, windows: Windows) -> Iterator[_Rows]:
    """A few people at a time, so that their activations stay in the cache."""
    valid = torch.nonzero(windows.valid).squeeze(1)
    person = windows.person[valid]
    counts = torch.bincount(person, minlength=len(windows.people))
    for name, count in zip(windows.people, counts.tolist(), strict=True):
        if count == 0:
            raise InvalidLabels(f"{name!r} has no valid label to calibrate on; label a rollout.")
    own = valid[torch.argsort(person, stable=True)].split(counts.tolist())
    together = max(1, _ROWS // int(counts.max()))
    for start in range(0, len(own), together):
        few = own[start : start + together]
        rows = torch.nn.utils.rnn.pad_sequence(list(few), batch_first=True, padding_value=-1)
        present = rows >= 0
        encoding = encode(network, windows.inputs[rows[present]])
        padded = torch.zeros(*rows.shape, encoding.shape[1])
        padded[present] = encoding
        yield _Rows(
            encoding=padded,
            for_f=network.difference.of_encoding(padded),
            for_g=network.inference.of_encoding(padded),
            # A masked step's difference is NaN, and padding points at some step: not 0 * NaN.
            difference=torch.where(present, windows.difference[rows], 0.0),
            counts=present.float(),
        )


def _fit(
    network: MindMeld, rows: _Rows, start: Tensor, weight: float, config: CalibrationConfig
) -> Tensor:
    people = len(rows.counts)
    embeddings = start.repeat(people, 1)
    coarse = rows.every(_COARSE)
    embeddings = _descend(network, coarse, embeddings, weight, config.coarse_iterations, config)
    return _descend(network, rows, embeddings, weight, config.iterations, config)


def _descend(
    network: MindMeld,
    rows: _Rows,
    embeddings: Tensor,
    weight: float,
    iterations: int,
    config: CalibrationConfig,
) -> Tensor:
    damping = torch.full((len(embeddings),), config.damping, dtype=torch.float64)
    current = _normal_equations(network, rows, embeddings, weight)
    for _ in range(iterations):
        step = _damped_step(current, damping)
        promised = (step * current.gradient).sum(1)
        if bool((promised <= config.tolerance * current.loss).all()):
            break
        candidate = embeddings - step.to(embeddings.dtype)
        tried = _normal_equations(network, rows, candidate, weight)
        better = tried.loss < current.loss
        embeddings = torch.where(better[:, None], candidate, embeddings)
        current = _NormalEquations(
            torch.where(better, tried.loss, current.loss),
            torch.where(better[:, None], tried.gradient, current.gradient),
            torch.where(better[:, None, None], tried.matrix, current.matrix),
        )
        damping *= torch.where(better, config.accepted_factor, config.rejected_factor)
    return embeddings


def _damped_step(equations: _NormalEquations, damping: Tensor) -> Tensor:
    diagonal = equations.matrix.diagonal(dim1=1, dim2=2)
    floor = 1e-9 * diagonal.amax(dim=1, keepdim=True) + 1e-12  # a direction nothing depends on
    damped = equations.matrix + torch.diag_embed(damping[:, None] * diagonal + floor)
    return torch.linalg.solve(damped, equations.gradient)


def _normal_equations(
    network: MindMeld, rows: _Rows, embeddings: Tensor, weight: float
) -> _NormalEquations:
    """J'J and J'r of both terms of Eq. 2 by products over rows; J itself is never stacked.

    With b the derivative of f by w, g's mean m and its derivative s by the difference, a row's
    second residual is ``m - w`` and its derivative ``s b' - I``.
    """
    people, size = embeddings.shape
    predicted, b = network.difference.with_jacobian(rows.for_f, embeddings)
    b = b * rows.counts[..., None]
    residual = (predicted - rows.difference) * rows.counts  # (people, rows)
    loss = residual.square().sum(1)
    pull, curvature = residual, torch.ones_like(residual)  # of each row along its b
    gradient, matrix = torch.zeros_like(embeddings), torch.zeros(people, size, size)
    if weight > 0.0:
        scale = weight / size
        mean, s = network.inference.mean_with_derivative(rows.for_g, predicted)
        away = (mean - embeddings[:, None]) * rows.counts[..., None]
        loss = loss + scale * away.square().sum((1, 2))
        pull = pull + scale * (s * away).sum(2)
        curvature = curvature + scale * s.square().sum(2)
        cross = s.transpose(1, 2) @ b  # (people, d, d)
        identity = torch.eye(size) * rows.counts.sum(1)[:, None, None]
        gradient = -scale * away.sum(1)
        matrix = scale * (identity - cross - cross.transpose(1, 2))
    gradient = gradient + (b * pull[..., None]).sum(1)
    matrix = matrix + b.transpose(1, 2) @ (b * curvature[..., None])
    return _NormalEquations(loss.double(), gradient.double(), matrix.double())


def _certainty(network: MindMeld, rows: _Rows, embeddings: Tensor) -> tuple[Tensor, Tensor]:
    """Information on w (people, d, d) and g's sigma (people, d); see ``CalibratedPeople``."""
    size = embeddings.shape[1]
    predicted, b = network.difference.with_jacobian(rows.for_f, embeddings)
    b = b * rows.counts[..., None]
    residual = (predicted - rows.difference) * rows.counts
    counts = rows.counts.sum(1)
    square = residual.square().sum(1)
    variance = square / (counts - size).clamp(min=1.0)
    # Neighbouring windows share labels and noise. n of them whose residuals correlate by rho tell
    # as much as n (1 - rho) / (1 + rho) independent ones would (an AR(1) process).
    rho = (residual[:, 1:] * residual[:, :-1]).sum(1) / square.clamp(min=1e-12)
    rho = rho.clamp(0.0, 0.99)
    independent = (1.0 - rho) / (1.0 + rho) / variance.clamp(min=1e-9)
    information = independent[:, None, None] * (b.transpose(1, 2) @ b)
    flat = rows.encoding.flatten(0, 1)
    _, log_sigma = network.inference(flat, predicted.flatten())
    g_variance = (2.0 * log_sigma).exp().unflatten(0, predicted.shape) * rows.counts[..., None]
    return information.double(), (g_variance.sum(1) / counts[:, None]).sqrt()
