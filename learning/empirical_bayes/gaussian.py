"""Gaussian linear models of many people at once: posteriors, and their prior by EM.

Person p: ``y = X beta_p + noise``, noise variance ``sigma_p²``, ``beta_p ~ N(mean, covariance)``.
Lindley & Smith, *Bayes estimates for the linear model*, JRSS B 1972; EM after Dempster, Laird &
Rubin 1977. All that is needed of the data are sums, so rollouts add up.
"""

from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.sim.arrays import FloatArray

_SHRUNK_VARIANCE = 0.01


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Moments:
    """Sums over rows, of many people (or rollouts) along the leading axis.

    Attributes:
        xx: (people, features, features), of ``x xᵀ``.
        xy: (people, features), of ``x y``.
        yy: (people,), of ``y²``.
        rows: (people,), how many.
    """

    xx: FloatArray
    xy: FloatArray
    yy: FloatArray
    rows: FloatArray

    @classmethod
    def of(cls, x: FloatArray, y: FloatArray) -> "Moments":
        """Moments of one person's rows: x (rows, features), y (rows,)."""
        return cls(
            xx=(x.T @ x)[None],
            xy=(x.T @ y)[None],
            yy=np.array([y @ y]),
            rows=np.array([float(len(y))]),
        )

    @classmethod
    def concatenate(cls, moments: "list[Moments]") -> "Moments":
        """Moments of all people of ``moments``, in order."""
        return cls(
            xx=np.concatenate([part.xx for part in moments]),
            xy=np.concatenate([part.xy for part in moments]),
            yy=np.concatenate([part.yy for part in moments]),
            rows=np.concatenate([part.rows for part in moments]),
        )

    def __getitem__(self, people: slice | list[int]) -> "Moments":
        """The chosen people."""
        return Moments(
            xx=self.xx[people], xy=self.xy[people], yy=self.yy[people], rows=self.rows[people]
        )

    def __add__(self, other: "Moments") -> "Moments":
        """Moments of the same people with the rows of ``other`` added."""
        return Moments(
            xx=self.xx + other.xx,
            xy=self.xy + other.xy,
            yy=self.yy + other.yy,
            rows=self.rows + other.rows,
        )

    def summed(self, people: int) -> "Moments":
        """Sums over equally many rollouts of each person, which must lie side by side."""
        return Moments(
            xx=self.xx.reshape(people, -1, *self.xx.shape[1:]).sum(axis=1),
            xy=self.xy.reshape(people, -1, *self.xy.shape[1:]).sum(axis=1),
            yy=self.yy.reshape(people, -1).sum(axis=1),
            rows=self.rows.reshape(people, -1).sum(axis=1),
        )

    def grouped(self, weights: FloatArray) -> "Moments":
        """Weighted sums: weights (groups, people) -> Moments of (groups, ...)."""
        return Moments(
            xx=np.tensordot(weights, self.xx, 1),
            xy=weights @ self.xy,
            yy=weights @ self.yy,
            rows=weights @ self.rows,
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Prior:
    """What is known of a person before any label.

    Attributes:
        mean: (features,).
        covariance: (features, features).
        noise: the people's typical noise variance, counted as ``noise_rows`` tempered rows.
        temper: the share of each row that counts: neighbouring rows hold much the same noise.
    """

    mean: FloatArray
    covariance: FloatArray
    noise: float
    noise_rows: float = 3.0
    temper: float = 0.1


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Posterior:
    """Of many people: mean (people, features), covariance (people, ...), noise variance (people,)."""

    mean: FloatArray
    covariance: FloatArray
    noise: FloatArray


def posterior(moments: Moments, prior: Prior, iterations: int = 4) -> Posterior:
    """Everyone's posterior: exact for a known noise, which a few EM steps from the prior's find."""
    precision = _inverse(prior.covariance)
    pull = precision @ prior.mean
    noise = np.full(len(moments.rows), prior.noise)
    for _ in range(iterations):
        mean, covariance = given_noise(moments, prior.temper, precision, pull, noise)
        noise = _noise(moments, prior, mean, covariance)
    mean, covariance = given_noise(moments, prior.temper, precision, pull, noise)
    return Posterior(mean=mean, covariance=covariance, noise=noise)


def given_noise(
    moments: Moments, temper: float, precision: FloatArray, pull: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Posterior mean and covariance for noise variances (people,).

    Args:
        temper: power of the likelihood.
        precision: of the prior.
        pull: ``precision @ mean`` of the prior.
    """
    scale = temper / noise
    covariance = _inverse(precision + scale[:, None, None] * moments.xx)
    mean = np.einsum("pij,pj->pi", covariance, pull + scale[:, None] * moments.xy)
    return mean, covariance


def fit_prior(
    moments: Moments,
    *,
    temper: float = 0.1,
    iterations: int = 30,
    start_variance: float = 1.0,
    shrinkage_people: float = 2.0,
) -> Prior:
    """The prior under which the people's data are likeliest, by EM.

    Args:
        temper: power of the likelihood.
        iterations: EM steps.
        start_variance: of every coefficient at the start.
        shrinkage_people: as many imagined people, of variance ``_SHRUNK_VARIANCE`` times the
            start's, join the real ones; they keep few people's covariance from collapsing.

    Raises:
        InvalidLabels: fewer than two people, or someone without a row.
    """
    people, features = moments.xy.shape
    if people < 2 or not (moments.rows > 0.0).all():
        raise InvalidLabels(
            f"{people} people, the least with {moments.rows.min() if people else 0:g} labels: a "
            "prior over people needs at least two, each with a valid label inside a rollout."
        )
    start = start_variance * np.eye(features)
    pooled = moments.summed(1)
    mean = np.linalg.solve(pooled.xx[0] + np.eye(features), pooled.xy[0])
    prior = Prior(
        mean=mean,
        covariance=start,
        noise=float(max(pooled.yy[0] - mean @ pooled.xy[0], 1e-6) / pooled.rows[0]),
        temper=temper,
    )
    noise = np.full(people, prior.noise)
    for _ in range(iterations):
        precision = _inverse(prior.covariance)
        means, covariances = given_noise(moments, temper, precision, precision @ prior.mean, noise)
        noise = _noise(moments, prior, means, covariances)
        centre = means.mean(axis=0)
        spread = covariances.sum(axis=0) + (means - centre).T @ (means - centre)
        prior = Prior(
            mean=centre,
            covariance=(spread + _SHRUNK_VARIANCE * shrinkage_people * start)
            / (people + shrinkage_people),
            noise=float(np.exp(np.log(noise).mean())),
            temper=temper,
        )
    return prior


def _noise(moments: Moments, prior: Prior, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Expected squared residual a row, (people,), with the prior's noise as a few rows more."""
    fitted = np.einsum("pij,pj->pi", moments.xx, mean)
    squares = moments.yy - 2.0 * (mean * moments.xy).sum(1) + (mean * fitted).sum(1)
    squares = np.maximum(squares, 0.0) + np.einsum("pij,pij->p", moments.xx, covariance)
    rows = prior.temper * moments.rows
    return (prior.temper * squares + prior.noise_rows * prior.noise) / (rows + prior.noise_rows)


def _inverse(matrices: FloatArray) -> FloatArray:
    return np.linalg.inv(matrices).astype(np.float64, copy=False)
