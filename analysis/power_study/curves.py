"""Power curves from counts of rejections, and the sample size that reaches a power."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.study_tables.plain import plain
from steerlab.sim.arrays import FloatArray

TARGETS = (0.8, 0.9)
_Z = 1.96


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerCurve:
    """One test's power by sample size.

    Attributes:
        people: (sizes,), rising.
        power: (sizes,) shares of studies that reject.
        error: (sizes,) their Monte-Carlo standard errors.
        studies: of each size.
    """

    test: str
    people: tuple[int, ...]
    power: FloatArray
    error: FloatArray
    studies: tuple[int, ...]

    @classmethod
    def of(
        cls, test: str, people: Sequence[int], rejected: Sequence[int], studies: Sequence[int]
    ) -> "PowerCurve":
        """From how often a study rejected."""
        power = np.array(rejected, dtype=np.float64) / np.array(studies)
        # Of a share of 0 or 1 the plain error would be 0: add two of each (Agresti & Coull 1998).
        smooth = (np.array(rejected) + 2.0) / (np.array(studies) + 4.0)
        error = np.sqrt(smooth * (1.0 - smooth) / (np.array(studies) + 4.0))
        return cls(
            test=test,
            people=tuple(people),
            power=power,
            error=error,
            studies=tuple(studies),
        )

    def people_for(self, target: float) -> "PeopleNeeded | NotComputable":
        """The sample size with that power: interpolated between sizes, never beyond them."""
        rising = _never_falling(self.power)
        found = _reach(self.people, rising, target)
        if found is None:
            return NotComputable(
                reason=f"power is {rising[-1]:.2f} with {self.people[-1]} people, the most tried"
            )
        few = _reach(self.people, _never_falling(self.power + _Z * self.error), target)
        many = _reach(self.people, _never_falling(self.power - _Z * self.error), target)
        return PeopleNeeded(
            people=_whole(found),
            low=_whole(found if few is None else few),
            high=None if many is None else _whole(many),
            at_most=bool(rising[0] >= target),
        )

    def values(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "test": self.test,
            "people": list(self.people),
            "power": plain(self.power),
            "monte_carlo_error": plain(self.error),
            "studies": list(self.studies),
            **{f"people_for_{round(100 * t)}": plain(self.people_for(t)) for t in TARGETS},
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class PeopleNeeded:
    """A sample size.

    Attributes:
        low, high: from 1.96 Monte-Carlo errors above and below the curve; ``high`` is None where
            the lower one does not get there.
        at_most: already the smallest size tried has that power.
    """

    people: int
    low: int
    high: int | None
    at_most: bool


def _whole(people: float) -> int:
    return ceil(people - 1e-6)  # a size that was tried is one, whatever its root rounds to


def _never_falling(power: FloatArray) -> FloatArray:
    """The closest curve that never falls (pool adjacent violators)."""
    blocks: list[list[float]] = []  # mean, size
    for value in power.tolist():
        blocks.append([value, 1.0])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            last, size = blocks.pop()
            mean, before = blocks[-1]
            blocks[-1] = [(mean * before + last * size) / (before + size), before + size]
    return np.concatenate([np.full(int(size), mean) for mean, size in blocks])


def _reach(people: Sequence[int], power: FloatArray, target: float) -> float | None:
    """Where the curve, straight over the root of n between sizes, first reaches ``target``."""
    at = int(np.argmax(power >= target))
    if power[at] < target:
        return None
    if at == 0:
        return float(people[0])
    low, high = sqrt(people[at - 1]), sqrt(people[at])
    share = (target - power[at - 1]) / (power[at] - power[at - 1])
    return float(low + share * (high - low)) ** 2
