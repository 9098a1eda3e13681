"""What calibration finds of people: from all their rollouts, or for each rollout from the others."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.empirical_bayes.gaussian import Prior, posterior
from steerlab.learning.empirical_bayes.grid import GridSeries, motion_on_grid
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.pretrained.model import KnownStyle, PretrainedModel, sums_of
from steerlab.learning.pretrained.style import (
    StyleMoments,
    concatenate,
    study_prior,
    style_moments,
    unit_of,
)
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import drive_names
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import FloatArray

_TURNS = 5
LEAST_PEOPLE = 3
"""Fewer have no style in common that one could tell from theirs."""


def motions_on_grid(series: Sequence[LabelSeries]) -> list[FloatArray]:
    """The car's motion of each, (samples, 3).

    Raises:
        InvalidLabels: a series does not carry it.
    """
    return [motion_on_grid(drive) for drive in series]


def known_people(
    model: PretrainedModel,
    series: Sequence[LabelSeries],
    motions: Sequence[FloatArray] | None,
    prior: Prior | None,
) -> tuple[tuple[str, ...], KnownStyle]:
    """People in order of appearance, each known from all their rollouts.

    Args:
        prior: of their study, where it is known.

    Raises:
        InvalidLabels: no series, or someone without a valid label.
    """
    if not series:
        raise InvalidLabels("No label series given; calibration needs at least one.")
    rows_of = _rows_of(series)
    parts = _RolloutParts(model, series, motions)
    for person, rows in rows_of.items():
        if not parts.moments.inverse.rows[rows].any():
            raise InvalidLabels(f"{person!r} has no valid label to calibrate on; label a rollout.")
    return tuple(rows_of), parts.known(list(rows_of.values()), prior)


def prior_of(model: PretrainedModel, series: Sequence[LabelSeries]) -> Prior | None:
    """What these people have in common; None of fewer than ``LEAST_PEOPLE`` with a valid label."""
    return _RolloutParts(model, series, None).prior(range(len(series)))


def known_from_others(
    model: PretrainedModel, series: Sequence[LabelSeries], motions: Sequence[FloatArray] | None
) -> tuple[list[int], KnownStyle] | None:
    """Which rollouts have others of the same person, and that person as the others show them.

    Nor does the study's prior know the drive: it is learned without a fifth of the drives in turn.
    None if nobody has two rollouts.
    """
    rows_of = _rows_of(series)
    others = [
        [other for other in rows_of[drive.person] if other != row]
        for row, drive in enumerate(series)
    ]
    parts = _RolloutParts(model, series, motions)
    kept = [row for row, rest in enumerate(others) if parts.moments.inverse.rows[rest].any()]
    if not kept:
        return None
    drive_of = drive_names(series)
    place = {drive: number for number, drive in enumerate(dict.fromkeys(drive_of.values()))}
    turn = [place[drive_of[drive.rollout]] % _TURNS for drive in series]
    known: dict[int, KnownStyle] = {}
    for now in sorted({turn[row] for row in kept}):
        rows = [row for row in kept if turn[row] == now]
        prior = parts.prior([row for row in range(len(series)) if turn[row] != now])
        found = parts.known([others[row] for row in rows], prior)
        known |= {row: found[[number]] for number, row in enumerate(rows)}
    return kept, KnownStyle.concatenate([known[row] for row in kept])


class _RolloutParts:
    """What each rollout says; what several say is the sum."""

    def __init__(
        self,
        model: PretrainedModel,
        series: Sequence[LabelSeries],
        motions: Sequence[FloatArray] | None,
    ) -> None:
        grids = [GridSeries.from_series(drive) for drive in series]
        unit_by_person = {
            person: unit_of([grids[row] for row in rows])
            for person, rows in _rows_of(series).items()
        }
        moments: list[StyleMoments] = []
        sums: list[np.ndarray] = []
        with torch_threads(1):
            for row, (drive, grid) in enumerate(zip(series, grids, strict=True)):
                unit = unit_by_person[drive.person]
                one = (grid.label[None], grid.truth[None], grid.valid[None], unit)
                moments.append(style_moments(*one))
                motion = None if motions is None else motions[row][None]
                sums.append(sums_of(model.network, *one, motion))
        self._model = model
        self._person = [drive.person for drive in series]
        self.moments = concatenate(moments)
        self._sums = np.concatenate(sums)

    def prior(self, rows: Sequence[int]) -> Prior | None:
        """What people have in common, by these rollouts; None of too few people."""
        of_person: dict[str, list[int]] = {}
        for row in rows:
            if self.moments.inverse.rows[row]:
                of_person.setdefault(self._person[row], []).append(row)
        if len(of_person) < LEAST_PEOPLE:
            return None
        return study_prior(
            concatenate([self.moments[theirs].summed(1) for theirs in of_person.values()])
        )

    def known(self, groups: Sequence[Sequence[int]], prior: Prior | None) -> KnownStyle:
        """People who are known from these rollouts each."""
        moments = concatenate([self.moments[list(rows)].summed(1) for rows in groups])
        own, style = self._model.encoder(moments)
        of_study = own if prior is None else posterior(moments.inverse, prior).mean
        return KnownStyle(
            unit=moments.unit,
            in_study=np.full(len(own), prior is not None),
            coefficients=np.stack([of_study, own], axis=1),
            style=style,
            sums=np.stack([self._sums[list(rows)].sum(axis=0) for rows in groups]),
        )


def _rows_of(series: Sequence[LabelSeries]) -> dict[str, list[int]]:
    rows: dict[str, list[int]] = {}
    for row, drive in enumerate(series):
        rows.setdefault(drive.person, []).append(row)
    return rows
