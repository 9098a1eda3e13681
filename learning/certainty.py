"""How sure a new person's embedding is, and whether it lies among those the network knows."""

import logging
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.sim.arrays import FloatArray

log = logging.getLogger(__name__)

QUANTILE = 0.999  # of people like the training people, one in a thousand is warned of
EXTRA_PEOPLE = 3  # a spread over d dimensions needs more than d people


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """A new person's embedding, how sure it is and how far from the training people's.

    Attributes:
        embedding: (d,), w.
        covariance: (d, d) of w: what the labels leave open, given the spread of the training
            people. Gauss-Newton: right where f is near linear in w, and for a person whom the
            network can describe.
        g_sigma: (d,), root mean square of g's sigma over the windows. Eq. 2 compares samples of
            w_hat with w by squared error, which is least without spread: g learns to be sure, and
            this is no measure of doubt. The covariance is.
        distance: Mahalanobis distance of w from the training people's mean, in their spread; None
            where they are too few to tell.
        outside: further out than ``QUANTILE`` of people like them would be. The network never saw
            such a style: look at the labels before trusting the mapped ones.
    """

    embedding: FloatArray
    covariance: FloatArray
    g_sigma: FloatArray
    distance: float | None
    outside: bool

    def __post_init__(self) -> None:
        size = len(self.embedding)
        if self.covariance.shape != (size, size) or self.g_sigma.shape != (size,):
            raise InvalidLabels(
                f"covariance {self.covariance.shape} and g_sigma {self.g_sigma.shape} do not fit "
                f"an embedding of {size}."
            )

    @property
    def sigma(self) -> FloatArray:
        """Standard deviation of each dimension of w, (d,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingPeople:
    """Where the training people's embeddings lie: the prior of a new person's.

    Attributes:
        count: how many people.
        mean: (d,).
        covariance: (d, d); its diagonal alone where they are too few for more.
    """

    count: int
    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, embeddings: FloatArray) -> "TrainingPeople":
        """Mean and covariance of the embeddings (people, d)."""
        count, size = embeddings.shape
        away = embeddings - embeddings.mean(axis=0)
        covariance = away.T @ away / max(count - 1, 1)
        covariance += 1e-6 * np.eye(size)
        if count < size + EXTRA_PEOPLE:
            covariance = np.diag(np.diag(covariance))
        return cls(count=count, mean=embeddings.mean(axis=0), covariance=covariance)

    def distance(self, embedding: FloatArray) -> float | None:
        """Mahalanobis distance of (d,); None where the people are too few to tell."""
        if self.count < len(self.mean) + EXTRA_PEOPLE:
            return None
        away = embedding - self.mean
        return float(np.sqrt(away @ np.linalg.solve(self.covariance, away)))

    def furthest(self, quantile: float = QUANTILE) -> float:
        """The distance that ``quantile`` of people like these stay within.

        Hotelling's prediction region; for many people it is the square root of chi-square's
        quantile, for few it is wider, since mean and spread are estimates.
        """
        from scipy.special import fdtri

        people, size = self.count, len(self.mean)
        scale = size * (people - 1) * (people + 1) / (people * (people - size))
        return float(np.sqrt(scale * fdtri(size, people - size, quantile)))

    def judge(
        self, person: str, embedding: FloatArray, information: FloatArray, g_sigma: FloatArray
    ) -> Calibrated:
        """The certainty of a calibrated person; logs a warning if they lie far outside.

        Args:
            person: for the warning.
            embedding: (d,).
            information: (d, d), of the labels; see ``CalibratedPeople``.
            g_sigma: (d,).
        """
        distance = self.distance(embedding)
        outside = distance is not None and distance > self.furthest()
        if outside:
            log.warning(
                "%s has a style unlike the %d training people's: their embedding is %.1f spreads "
                "from the mean, where %.1f holds all but one in a thousand. Look at their labels "
                "before trusting the mapped ones.",
                person,
                self.count,
                distance,
                self.furthest(),
            )
        return Calibrated(
            embedding=embedding,
            covariance=np.asarray(
                np.linalg.inv(information + np.linalg.inv(self.covariance)), dtype=np.float64
            ),
            g_sigma=g_sigma,
            distance=distance,
            outside=outside,
        )
