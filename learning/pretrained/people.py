"""What calibration reads of people's series: sums for their style, and the car's motion."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.empirical_bayes.grid import GridSeries, grid_positions
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.pretrained.style import StyleMoments, concatenate, style_moments
from steerlab.learning.series import CONTEXT, LabelSeries
from steerlab.sim.arrays import FloatArray


def motion_on_grid(series: LabelSeries) -> FloatArray:
    """The car's motion on the grid, (samples, 3), columns as ``series.CONTEXT``.

    Raises:
        InvalidLabels: the series does not carry it.
    """
    missing = [name for name in CONTEXT if name not in series.context_names]
    if missing:
        raise InvalidLabels(
            f"Series of {series.person!r} on {series.rollout!r} has no {', '.join(missing)}; "
            "record the car's motion or use sim_pretrained, which reads labels only."
        )
    positions, steps = grid_positions(series), np.arange(series.steps, dtype=np.float64)
    columns = [series.context[:, series.context_names.index(name)] for name in CONTEXT]
    return np.column_stack([np.interp(positions, steps, column) for column in columns])


def person_moments(series: Sequence[LabelSeries]) -> tuple[tuple[str, ...], StyleMoments]:
    """People in order of appearance, and the sums of each over their rollouts.

    Raises:
        InvalidLabels: no series, or someone without a valid label.
    """
    if not series:
        raise InvalidLabels("No label series given; calibration needs at least one.")
    people: dict[str, StyleMoments] = {}
    for one in series:
        grid = GridSeries.from_series(one)
        own = style_moments(grid.label[None], grid.truth[None], grid.valid[None])
        people[one.person] = people[one.person] + own if one.person in people else own
    for person, own in people.items():
        if not own.inverse.rows.any():
            raise InvalidLabels(f"{person!r} has no valid label to calibrate on; label a rollout.")
    return tuple(people), concatenate(list(people.values()))
