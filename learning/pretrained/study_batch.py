"""A study's rollouts side by side, each with its person's style from their *other* rollouts.

What is learned or measured on them then holds for rollouts that did not calibrate anyone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.empirical_bayes.grid import GridSeries
from steerlab.learning.pretrained.model import PretrainedModel, closed_form
from steerlab.learning.pretrained.style import concatenate, style_moments
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray
from steerlab.sim.rollout import BoolArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StudyBatch:
    """Rollouts of a study on the grid, padded to one length: (rollouts, samples).

    Attributes:
        label, prediction: bridged labels, and the closed form's truth.
        present, valid: there is a label; label and truth may train or score.
        truth: 0 beyond the end.
        motion: (rollouts, samples, 3), or None.
        coefficients, style: (rollouts, ...) of the closed form, and w.
        rollout: name of each.
    """

    label: FloatArray
    prediction: FloatArray
    present: BoolArray
    truth: FloatArray
    valid: BoolArray
    motion: FloatArray | None
    coefficients: FloatArray
    style: FloatArray
    rollout: tuple[str, ...]


def study_batch(
    model: PretrainedModel, series: Sequence[LabelSeries], motions: Sequence[FloatArray] | None
) -> StudyBatch | None:
    """Each rollout with the style of its person found from that person's other rollouts.

    None if nobody has two rollouts.

    Args:
        model: whose encoder finds the styles.
        series: of the training people; someone with a single rollout is left out.
        motions: the car's motion on the grid of each series, or None.
    """
    grids = [GridSeries.from_series(one) for one in series]
    parts = [style_moments(one.label[None], one.truth[None], one.valid[None]) for one in grids]
    moments = concatenate(parts)
    rows_of: dict[str, list[int]] = {}
    for row, one in enumerate(series):
        rows_of.setdefault(one.person, []).append(row)
    others = [
        [other for other in rows_of[one.person] if other != row] for row, one in enumerate(series)
    ]
    kept = [row for row, rest in enumerate(others) if moments.inverse.rows[rest].any()]
    if not kept:
        return None
    coefficients, style = model.encoder(
        concatenate([moments[others[row]].summed(1) for row in kept])
    )
    samples = max(len(grids[row].label) for row in kept)

    def padded(name: str) -> np.ndarray:
        values = [getattr(grids[row], name) for row in kept]
        return np.stack([np.pad(one, (0, samples - len(one))) for one in values])

    def held(values: FloatArray) -> FloatArray:
        return values[np.minimum(np.arange(samples), len(values) - 1)]

    label = np.stack([held(grids[row].label) for row in kept])
    return StudyBatch(
        label=label,
        prediction=closed_form(label, coefficients),
        present=padded("present"),
        truth=padded("truth"),
        valid=padded("valid"),
        motion=None if motions is None else np.stack([held(motions[row]) for row in kept]),
        coefficients=coefficients,
        style=style,
        rollout=tuple(series[row].rollout for row in kept),
    )
