"""A new person's embedding with the network frozen: Levenberg-Marquardt over many at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.normal_equations import PeopleWindows, Sums, normal_equations
from steerlab.learning.series import LabelSeries
from steerlab.learning.windows import Windows

_COARSE = 4  # the first steps need only every fourth window,
_LEAST_COARSE = 400  # of people who have as many
_WINDOWS_AT_ONCE = 4096  # their states take 20 MB


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
    """The calibrated embeddings, in the order of ``Windows.people``.

    Attributes:
        embeddings: (people, d), w.
        information: (people, d, d), how sharply the labels determine w: the Gauss-Newton matrix
            over the residual variance, corrected for windows that repeat each other.
        g_sigma: (people, d), root mean square of g's sigma: how sure a single window is.
    """

    embeddings: Tensor
    information: Tensor
    g_sigma: Tensor


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
    with torch.no_grad():
        encoding, difference, counts = _by_person(network, windows)
        coarse = torch.where(counts < _LEAST_COARSE, 1, _COARSE)
        every_fourth = PeopleWindows.of(network, encoding, difference, counts, coarse)
        every = PeopleWindows.of(network, encoding, difference, counts, torch.ones_like(counts))
        embeddings = start.repeat(len(counts), 1)
        for rows, iterations in (
            (every_fourth, config.coarse_iterations),
            (every, config.iterations),
        ):
            embeddings = _descend(
                network, rows, embeddings, embedding_loss_weight, iterations, config
            )
        return _with_certainty(network, every, embeddings)


def encode(network: MindMeld, inputs: Tensor) -> Tensor:
    """Encode many windows: (rows, window, channels) -> (rows, k)."""
    with torch.no_grad():
        return torch.cat([network.encoder(chunk) for chunk in inputs.split(_WINDOWS_AT_ONCE)])


def spread_rows(series: Sequence[LabelSeries], most: int) -> npt.NDArray[np.int64]:
    """At most ``most`` valid steps of each person, evenly spread, counted through all series."""
    valid = np.flatnonzero(np.concatenate([drive.valid for drive in series]))
    steps = [drive.steps for drive in series]
    person = np.repeat([drive.person for drive in series], steps)[valid]
    chosen: list[npt.NDArray[np.int64]] = []
    for name in dict.fromkeys(drive.person for drive in series):
        rows = valid[person == name]
        if len(rows) > most:
            rows = rows[np.linspace(0, len(rows) - 1, most).round().astype(np.int64)]
        chosen.append(rows)
    return np.sort(np.concatenate(chosen))


def _by_person(network: MindMeld, windows: Windows) -> tuple[Tensor, Tensor, Tensor]:
    """Valid windows by person: encoding (windows, k), difference (windows,), counts (people,)."""
    valid = torch.nonzero(windows.valid).squeeze(1)
    person = windows.person[valid]
    counts = torch.bincount(person, minlength=len(windows.people))
    for name, count in zip(windows.people, counts.tolist(), strict=True):
        if count == 0:
            raise InvalidLabels(f"{name!r} has no valid label to calibrate on; label a rollout.")
    order = valid[torch.argsort(person, stable=True)]
    return encode(network, windows.inputs[order]), windows.difference[order], counts


def _descend(
    network: MindMeld,
    rows: PeopleWindows,
    embeddings: Tensor,
    weight: float,
    iterations: int,
    config: CalibrationConfig,
) -> Tensor:
    """Levenberg-Marquardt for everyone at once, each with their own damping and end."""
    result = embeddings.clone()
    going = torch.arange(len(embeddings))  # people whose windows are still in ``rows``
    damping = torch.full((len(embeddings),), config.damping, dtype=torch.float64)
    current, _ = normal_equations(network, rows, embeddings, weight)
    for _ in range(iterations):
        step = _damped_step(current, damping)
        left = (step * current.gradient).sum(1) > config.tolerance * current.loss
        if not bool(left.any()):
            break
        if 2 * int(left.sum()) <= len(left):  # whoever is done costs no more time
            result[going] = embeddings
            going, embeddings, damping, step = (
                values[left] for values in (going, embeddings, damping, step)
            )
            rows = PeopleWindows(*(values[left] for values in rows))
            current = Sums(*(values[left] for values in current))
            left = left[left]
        candidate = embeddings - step.to(embeddings.dtype)
        tried, _ = normal_equations(network, rows, candidate, weight)
        better = left & (tried.loss < current.loss)
        embeddings = torch.where(better[:, None], candidate, embeddings)
        current = Sums(
            *(
                torch.where(better.view(-1, *[1] * (new.dim() - 1)), new, old)
                for new, old in zip(tried, current, strict=True)
            )
        )
        damping *= torch.where(better, config.accepted_factor, config.rejected_factor)
    result[going] = embeddings
    return result


def _damped_step(equations: Sums, damping: Tensor) -> Tensor:
    diagonal = equations.matrix.diagonal(dim1=1, dim2=2)
    floor = 1e-9 * diagonal.amax(dim=1, keepdim=True) + 1e-12  # a direction nothing depends on
    damped = equations.matrix + torch.diag_embed(damping[:, None] * diagonal + floor)
    return torch.linalg.solve(damped, equations.gradient)


def _with_certainty(network: MindMeld, rows: PeopleWindows, embeddings: Tensor) -> CalibratedPeople:
    """``CalibratedPeople``: the embeddings, their information and g's sigma."""
    sums, residual = normal_equations(network, rows, embeddings, 0.0)
    counts = rows.there.double().sum(1)
    variance = sums.loss / (counts - embeddings.shape[1]).clamp(min=1.0)
    # Neighbouring windows share labels and noise. n of them whose residuals correlate by rho tell
    # as much as n (1 - rho) / (1 + rho) independent ones would (an AR(1) process).
    products = (residual[:, 1:] * residual[:, :-1]).sum(1)
    rho = (products / sums.loss.clamp(min=1e-12)).clamp(0.0, 0.99)
    independent = (1.0 - rho) / (1.0 + rho) / variance.clamp(min=1e-9)
    return CalibratedPeople(
        embeddings=embeddings,
        information=independent[:, None, None] * sums.matrix,
        g_sigma=(sums.sigma_square / counts[:, None]).sqrt().float(),
    )
