"""Does a whole embedding go together with one quantity? Multiple R with a permutation p-value."""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import f

from steerlab.analysis.statistics.noncentral import explained_interval
from steerlab.analysis.statistics.outcome import (
    Interval,
    NotComputable,
    checked,
    checked_confidence,
    flat,
    too_few,
)
from steerlab.analysis.statistics.permutation import PERMUTATIONS, permutation_p, permuted
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray


@dataclass(frozen=True, kw_only=True, slots=True)
class MultipleCorrelation:
    """How much of a quantity a plane over the embedding explains.

    Attributes:
        r: multiple R, 0 to 1: the correlation of the quantity and its best linear prediction. It
            does not change when the embedding is turned or scaled, and is above 0 by chance alone.
        r2: its square; ``adjusted_r2`` takes off what chance explains and may be negative.
        p: by permutation, (1 + as large) / (1 + permutations).
        f_p: of the F test, which supposes normal residuals.
        interval: of r, from the noncentral F for the embeddings that these people have.
    """

    r: float
    r2: float
    adjusted_r2: float
    p: float
    permutations: int
    f_p: float
    interval: Interval
    n: int
    dimensions: int


def multiple_correlation(
    embedding: FloatArray,
    construct: FloatArray,
    *,
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
    confidence: float = 0.95,
) -> MultipleCorrelation | NotComputable:
    """Multiple R of ``construct`` (n,) on ``embedding`` (n, d), with an intercept.

    Raises:
        InvalidConfig: lengths differ, a value is not finite, or ``permutations`` or ``confidence``
            is outside what it may be.
    """
    embedding, construct = checked("embedding", embedding, 2), checked("construct", construct)
    checked_confidence(confidence)
    n, size = embedding.shape
    if n != len(construct):
        raise InvalidConfig(f"embedding has {n} people and construct {len(construct)}.")
    if missing := too_few(n, max(4, size + 3)) or flat("the construct", construct):
        return missing
    if missing := dependent(embedding):
        return missing
    basis = np.linalg.qr(embedding - embedding.mean(axis=0))[0]
    centred = construct - construct.mean()
    centred = centred / sqrt(centred @ centred)
    r2 = min(1.0, float(np.square(basis.T @ centred).sum()))
    of_chance = np.square(permuted(centred, permutations, rng) @ basis).sum(axis=1)
    freedom = (size, n - size - 1)
    statistic = np.inf if r2 >= 1.0 else (r2 / freedom[0]) / ((1.0 - r2) / freedom[1])
    explained = explained_interval(statistic, *freedom, n=n, confidence=confidence)
    return MultipleCorrelation(
        r=sqrt(r2),
        r2=r2,
        adjusted_r2=1.0 - (1.0 - r2) * (n - 1) / freedom[1],
        p=permutation_p(r2, of_chance),
        permutations=permutations,
        f_p=float(f.sf(statistic, *freedom)),
        interval=Interval(
            low=sqrt(explained.low), high=sqrt(explained.high), confidence=confidence
        ),
        n=n,
        dimensions=size,
    )


def dependent(columns: FloatArray) -> NotComputable | None:
    """Why the columns (n, d) span less than d dimensions, if they do."""
    for at, column in enumerate(columns.T):
        if missing := flat(f"dimension {at}", column):
            return missing
    centred = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    rank = int(np.linalg.matrix_rank(centred))
    if rank < columns.shape[1]:
        return NotComputable(
            reason=f"{columns.shape[1]} dimensions span only {rank}: they follow from each other"
        )
    return None
