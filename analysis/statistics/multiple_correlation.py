"""Does a whole embedding go together with one quantity? Multiple R, its p-value by permutation."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import f

from steerlab.analysis.statistics.attainable import by_orders
from steerlab.analysis.statistics.noncentral import explained_interval
from steerlab.analysis.statistics.outcome import (
    ConfidenceInterval,
    NotComputable,
    checked,
    checked_confidence,
    dependent,
    flat,
    too_few,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

PERMUTATIONS = 9999
RULE = (
    "R is the root of the mean R² over networks; its p-value permutes the quantity for all of them "
    "at once, so that it holds however much they depend on each other"
)
"""How several networks are combined, in words."""
_ROUNDING = 1e-10  # relative: equal statistics of two orders differ by rounding


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
        smallest_p: that there can be with so many orders and permutations.
    """

    r: float
    r2: float
    adjusted_r2: float
    p: float
    permutations: int
    f_p: float
    interval: ConfidenceInterval
    n: int
    dimensions: int
    smallest_p: float


@dataclass(frozen=True, kw_only=True, slots=True)
class SeveralEmbeddings:
    """Multiple R over several networks that learned from the same people.

    Attributes:
        r: root of the mean R².
        p: by permutation of that mean.
        lowest, highest: R of single networks.
        interval: from the lowest to the highest limit of the networks' own intervals, so it covers
            at least as often as theirs.
    """

    r: float
    p: float
    permutations: int
    lowest: float
    highest: float
    interval: ConfidenceInterval
    n: int
    networks: int


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FirstComponent:
    """Where people lie along the direction in which they differ most.

    Attributes:
        scores: (n,), mean 0.
        direction: (d,), unit length; its largest entry is positive, which settles the sign.
        explained: share of the variance, 1/d to 1. Near 1/d the direction is an accident.
    """

    scores: FloatArray
    direction: FloatArray
    explained: float


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
    if missing := _too_few_or_flat(construct, size) or dependent(embedding):
        return missing
    basis, centred = basis_of(embedding), _unit(construct)
    r2 = min(1.0, float(explained_by(basis, centred)))
    statistic = _f_of(r2, n, size)
    return MultipleCorrelation(
        r=sqrt(r2),
        r2=r2,
        adjusted_r2=1.0 - (1.0 - r2) * (n - 1) / (n - size - 1),
        p=permutation_p(r2, explained_by(basis, permuted(centred, permutations, rng))),
        permutations=permutations,
        f_p=float(f.sf(statistic, size, n - size - 1)),
        interval=_interval_of_r(r2, n, size, confidence),
        n=n,
        dimensions=size,
        smallest_p=by_orders(construct, permutations),
    )


def several_embeddings(
    embeddings: Sequence[FloatArray],
    construct: FloatArray,
    *,
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
    confidence: float = 0.95,
) -> SeveralEmbeddings | NotComputable:
    """Combined multiple R of ``construct`` (n,) on each of ``embeddings`` (n, d).

    Under the null the construct has nothing to do with who lies where, so permuting it once for
    all networks is exact. With one network R and p are ``multiple_correlation``'s.

    Raises:
        InvalidConfig: no embedding, lengths differ, or a value is not finite.
    """
    construct = checked("construct", construct)
    checked_confidence(confidence)
    if not embeddings or any(len(embedding) != len(construct) for embedding in embeddings):
        raise InvalidConfig(
            f"{[len(embedding) for embedding in embeddings]} people in embeddings and {len(construct)} in the "
            "construct; give one embedding or more, each of the same people."
        )
    embeddings = [checked("embedding", embedding, 2) for embedding in embeddings]
    sizes = [embedding.shape[1] for embedding in embeddings]
    if missing := _too_few_or_flat(construct, max(sizes)):
        return missing
    for number, embedding in enumerate(embeddings, start=1):
        if missing := dependent(embedding):
            return NotComputable(reason=f"network {number}: {missing.reason}")
    n, bases, centred = (
        len(construct),
        [basis_of(embedding) for embedding in embeddings],
        _unit(construct),
    )
    each = [min(1.0, float(explained_by(basis, centred))) for basis in bases]
    shuffled = permuted(centred, permutations, rng)
    of_chance = np.mean([explained_by(basis, shuffled) for basis in bases], axis=0)
    combined = float(np.mean(each))
    intervals = [
        _interval_of_r(r2, n, size, confidence) for r2, size in zip(each, sizes, strict=True)
    ]
    return SeveralEmbeddings(
        r=sqrt(combined),
        p=permutation_p(combined, of_chance),
        permutations=permutations,
        lowest=sqrt(min(each)),
        highest=sqrt(max(each)),
        interval=ConfidenceInterval(
            low=min(interval.low for interval in intervals),
            high=max(interval.high for interval in intervals),
            confidence=confidence,
        ),
        n=n,
        networks=len(bases),
    )


def first_component(embedding: FloatArray) -> FirstComponent | NotComputable:
    """First principal component of ``embedding`` (n, d), without rescaling its dimensions.

    Raises:
        InvalidConfig: a value is not finite.
    """
    embedding = checked("embedding", embedding, 2)
    if missing := too_few(len(embedding)):
        return missing
    if all(flat("", column) for column in embedding.T):
        return NotComputable(reason="everyone has the same embedding")
    centred = embedding - embedding.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)
    direction = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
    return FirstComponent(
        scores=centred @ direction,
        direction=direction,
        explained=float(spread[0] ** 2 / np.square(spread).sum()),
    )


def permuted(values: FloatArray, permutations: int, rng: np.random.Generator) -> FloatArray:
    """``values`` (n,) in random orders, (permutations, n).

    Raises:
        InvalidConfig: fewer than 19 permutations, with which no p-value reaches 5 %.
    """
    if permutations < 19:
        raise InvalidConfig(f"permutations is {permutations}; fewer than 19 cannot reach 5 %.")
    return rng.permuted(np.broadcast_to(values, (permutations, len(values))), axis=1)


def permutation_p(observed: float, of_chance: FloatArray) -> float:
    """Share of statistics at least as large, the observed one among them, so never 0.

    Phipson & Smyth, Statistical Applications in Genetics and Molecular Biology 9, 2010.
    """
    as_large = int((of_chance >= observed - _ROUNDING * abs(observed)).sum())
    return (1 + as_large) / (1 + len(of_chance))


def basis_of(embedding: FloatArray) -> FloatArray:
    """Orthonormal columns (n, d) that span the centred ``embedding`` (n, d)."""
    return np.linalg.qr(embedding - embedding.mean(axis=0))[0]


def explained_by(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Sum of squares of ``values`` (..., n), centred, that ``basis`` (n, d) explains: (...)."""
    return np.asarray(np.square(values @ basis).sum(axis=-1))


def _unit(values: FloatArray) -> FloatArray:
    centred = values - values.mean()
    return centred / sqrt(centred @ centred)


def _too_few_or_flat(construct: FloatArray, size: int) -> NotComputable | None:
    return too_few(len(construct), max(4, size + 3)) or flat("the construct", construct)


def _f_of(r2: float, n: int, size: int) -> float:
    return np.inf if r2 >= 1.0 else (r2 / size) / ((1.0 - r2) / (n - size - 1))


def _interval_of_r(r2: float, n: int, size: int, confidence: float) -> ConfidenceInterval:
    statistic = _f_of(r2, n, size)
    share = explained_interval(statistic, size, n - size - 1, n=n, confidence=confidence)
    return ConfidenceInterval(low=sqrt(share.low), high=sqrt(share.high), confidence=confidence)
