"""Which conditions differ? All pairs, with Holm's correction over the pairs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Generic, TypeVar

import numpy as np

from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import NotComputable, checked_table
from steerlab.analysis.statistics.paired import McNemar, SignedRanks
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.rollout import FloatArray

PairTest = TypeVar("PairTest", SignedRanks, McNemar)


@dataclass(frozen=True, kw_only=True, slots=True)
class Pair(Generic[PairTest]):
    """Two conditions compared; ``p_holm`` counts the pairs that could be tested."""

    first: str
    second: str
    test: PairTest | NotComputable
    p_holm: float | NotComputable


def all_pairs(
    table: FloatArray,
    conditions: Sequence[str],
    test: Callable[[FloatArray, FloatArray], PairTest | NotComputable],
) -> list[Pair[PairTest]]:
    """Compare each two columns of ``table`` (people, conditions) by ``wilcoxon`` or ``mcnemar``.

    Raises:
        InvalidConfig: names and columns differ in number, or the test refuses the values.
    """
    table = checked_table("table", table)
    if len(conditions) != table.shape[1] or len(set(conditions)) != len(conditions):
        raise InvalidConfig(
            f"{table.shape[1]} columns and the names {list(conditions)}; give each its own."
        )
    names = list(combinations(range(len(conditions)), 2))
    found = [test(table[:, one], table[:, other]) for one, other in names]
    adjusted = iter(
        holm(np.array([one.p for one in found if not isinstance(one, NotComputable)])).tolist()
    )
    return [
        Pair(
            first=conditions[one],
            second=conditions[other],
            test=result,
            p_holm=result if isinstance(result, NotComputable) else next(adjusted),
        )
        for (one, other), result in zip(names, found, strict=True)
    ]
