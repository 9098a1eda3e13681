"""One quantity and the embeddings of several networks: what does not depend on a training seed?"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from steerlab.analysis.statistics.multiple_correlation import dependent, multiple_correlation
from steerlab.analysis.statistics.outcome import Interval, NotComputable, checked, flat, too_few
from steerlab.analysis.statistics.permutation import PERMUTATIONS, permutation_p, permuted
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

RULE = (
    "R is the root of the mean R² over networks; its p-value permutes the quantity for all of them "
    "at once, so that it holds however much they depend on each other"
)
"""How the networks are combined, in words."""


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
    interval: Interval
    n: int
    networks: int


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
    if not embeddings or any(len(one) != len(construct) for one in embeddings):
        raise InvalidConfig(
            f"{[len(one) for one in embeddings]} people in embeddings and {len(construct)} in the "
            "construct; give one embedding or more, each of the same people."
        )
    checked_ = [checked("embedding", one, 2) for one in embeddings]
    n, size = len(construct), max(one.shape[1] for one in checked_)
    if missing := too_few(n, max(4, size + 3)) or flat("the construct", construct):
        return missing
    bases: list[FloatArray] = []
    intervals: list[Interval] = []
    for number, one in enumerate(checked_, start=1):
        if missing := dependent(one):
            return NotComputable(reason=f"network {number}: {missing.reason}")
        bases.append(np.linalg.qr(one - one.mean(axis=0))[0])
        alone = multiple_correlation(
            one, construct, rng=np.random.default_rng(0), permutations=19, confidence=confidence
        )  # for its interval, which needs no permutations
        if isinstance(alone, NotComputable):
            return alone
        intervals.append(alone.interval)
    centred = construct - construct.mean()
    centred = centred / sqrt(centred @ centred)
    each = [float(np.square(basis.T @ centred).sum()) for basis in bases]
    shuffled = permuted(centred, permutations, rng)
    of_chance = np.mean([np.square(shuffled @ basis).sum(axis=1) for basis in bases], axis=0)
    combined = min(1.0, float(np.mean(each)))
    return SeveralEmbeddings(
        r=sqrt(combined),
        p=permutation_p(combined, of_chance),
        permutations=permutations,
        lowest=sqrt(min(1.0, *each)),
        highest=sqrt(min(1.0, max(each))),
        interval=Interval(
            low=min(one.low for one in intervals),
            high=max(one.high for one in intervals),
            confidence=confidence,
        ),
        n=n,
        networks=len(bases),
    )
