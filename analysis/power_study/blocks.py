"""One block of simulated studies: a unit of work that depends on its place alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.power_study.simulated_studies import (
    reject_correlations,
    reject_outcomes,
    resample_outcomes,
    simulate_correlations,
    simulate_outcomes,
)
from steerlab.sim.arrays import FloatArray

BLOCK = 100
"""Studies of a block: less than a second, so that little is lost when a run is stopped."""


def run_block(
    design: PowerDesign, people: int, number: int, taught: tuple[tuple[str, ...], FloatArray] | None
) -> dict[str, int]:
    """How many of ``BLOCK`` studies of ``people`` reject, by test.

    The same design, size and number give the same counts, whatever else is run.

    Args:
        taught: conditions and outcomes (teachers, conditions) to draw people from, in place of the
            outcome model.
    """
    rng = np.random.default_rng([design.seed, people, number])
    found = reject_correlations(simulate_correlations(design, people, BLOCK, rng), design.alpha)
    if taught is not None:
        names, table = taught
        outcomes = resample_outcomes(table, people, BLOCK, rng)
        found |= reject_outcomes(outcomes, names, design.ours, design.alpha)
    elif design.conditions:
        outcomes = simulate_outcomes(design, people, BLOCK, rng)
        names = tuple(one.name for one in design.conditions)
        found |= reject_outcomes(outcomes, names, design.ours, design.alpha)
    return {test: int(rejected.sum()) for test, rejected in found.items()}


def add_up(blocks: list[Mapping[str, Any]]) -> dict[str, int]:
    """Rejections of several blocks of one size."""
    total: dict[str, int] = {}
    for block in blocks:
        for test, count in block.items():
            total[test] = total.get(test, 0) + int(count)
    return total
