"""``SimPretrainedMapper``: a network taught by simulated teachers, calibrated in closed form."""

from collections.abc import Sequence

import numpy as np

from steerlab.learning.empirical_bayes.gaussian import Prior
from steerlab.learning.empirical_bayes.grid import GridSeries, from_grid
from steerlab.learning.errors import NotFitted
from steerlab.learning.pretrained.correction_share import best_share
from steerlab.learning.pretrained.expected_error import ErrorScale, measure_error_scale
from steerlab.learning.pretrained.fine_tuning import FineTuningConfig, fine_tuned, study_batch
from steerlab.learning.pretrained.known_people import known_people, motions_on_grid, prior_of
from steerlab.learning.pretrained.model import KnownStyle, PretrainedModel, map_labels
from steerlab.learning.pretrained.style import HOW_MANY, LARGEST
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.learning.pretrained.weights import load_shipped_model
from steerlab.learning.series import LabelSeries, lookup_person
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

FINE_TUNING = FineTuningConfig()
_UNLIKE = 2


class SimPretrainedMapper:
    """Shipped weights; a person's style is found in closed form.

    The network stays frozen unless fine-tuning on the training people helps on rollouts of theirs
    that were held out for the choice. Not a method of the paper and shown on simulated teachers
    only; MIND MELD stays beside it.

    Args:
        context: also read the car's own motion, which every series must then carry.
        model: in place of the shipped weights.
        fine_tuning: how to fine-tune; None keeps the network frozen, which is quick.
        seed: of fine-tuning's batches.
    """

    def __init__(
        self,
        *,
        context: bool = False,
        model: PretrainedModel | None = None,
        fine_tuning: FineTuningConfig | None = FINE_TUNING,
        seed: int = 0,
    ) -> None:
        self.name = "sim_pretrained_context" if context else "sim_pretrained"
        self._context = context
        self._model = model or load_shipped_model()
        self._fine_tuning = fine_tuning
        self._seed = seed
        self._network = self._model.network
        self._gain = 0.0
        self._prior: Prior | None = None
        self._correction_share = 1.0
        self._error_scale: ErrorScale | None = None
        self._people: dict[str, KnownStyle] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Calibrate the training people and choose the network; forgets everything before.

        Raises:
            InvalidLabels: no series, or someone without a valid label.
        """
        self._people, self._network, self._gain = {}, self._model.network, 0.0
        self._error_scale, self._prior, self._correction_share = (
            None,
            prior_of(self._model, series),
            1.0,
        )
        self.calibrate(series)
        motions = motions_on_grid(series) if self._context else None
        batch = study_batch(self._model, series, motions)
        if batch is None:  # one rollout a person: nothing is left to choose or measure on
            return
        unseen = np.ones(len(batch.rollout), dtype=bool)
        if self._fine_tuning is not None:
            tuning = fine_tuned(self._model, batch, self._seed, self._fine_tuning)
            self._network, self._gain, unseen = tuning.network, tuning.gain, tuning.unseen
        self._correction_share = best_share(self._model, self._network, batch, unseen)
        self._error_scale = measure_error_scale(
            self._model, self._network, batch, unseen, self._correction_share
        )

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """The style of the people in ``series``; someone known gets a new one.

        Raises:
            InvalidLabels: no series, or someone without a valid label.
        """
        motions = motions_on_grid(series) if self._context else None
        people, known = known_people(self._model, series, motions, self._prior)
        self._people |= {person: known[[row]] for row, person in enumerate(people)}

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        return self._map([series])[0][0]

    def map_many(self, series: Sequence[LabelSeries]) -> list[FloatArray]:
        """What ``map`` gives for each of ``series``, up to the last bits; many at a time.

        Raises:
            UnknownPerson: someone was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        return [mapped for mapped, _ in self._map(series)]

    def map_with_spread(self, series: LabelSeries) -> tuple[FloatArray, FloatArray]:
        """Mapped labels and the absolute error to expect of each, (steps,) both.

        Raises:
            NotFitted: no errors were measured; see ``error_scale``.
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        mapped, stated = self._map([series])[0]
        return mapped, self.error_scale.factor * stated

    def map_with_interval(
        self, series: LabelSeries, share: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mapped labels, and from where to where ``share`` of the truths lie, (steps,) each.

        Raises:
            InvalidConfig: ``share`` is not between 0 and 1.
            NotFitted: no errors were measured; see ``error_scale``.
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        mapped, stated = self._map([series])[0]
        half = self.error_scale.half_width(share) * stated
        limits = (-WHEEL_LIMIT, WHEEL_LIMIT)
        return mapped, np.clip(mapped - half, *limits), np.clip(mapped + half, *limits)

    def _map(self, series: Sequence[LabelSeries]) -> list[tuple[FloatArray, FloatArray]]:
        """For each series, mapped labels and the errors the network states, (steps,) both."""
        grids = [GridSeries.from_series(drive) for drive in series]
        alike: dict[int, list[int]] = {}  # of one length: padding would change what lies at ends
        for row, grid in enumerate(grids):
            alike.setdefault(len(grid.label), []).append(row)
        by_row: dict[int, tuple[FloatArray, FloatArray]] = {}
        for rows in alike.values():
            people = [self.person(series[row].person) for row in rows]
            motions = motions_on_grid([series[row] for row in rows]) if self._context else None
            with torch_threads(1):  # too little work to share between threads
                mapped, stated = map_labels(
                    self._network,
                    self._model.style_readout,
                    KnownStyle.concatenate(people),
                    np.stack([grids[row].label for row in rows]),
                    np.stack([grids[row].present for row in rows]),
                    None if motions is None else np.stack(motions),
                    self._correction_share,
                )
            for row, labels, error in zip(rows, mapped, stated, strict=True):
                given = np.isfinite(series[row].label)
                by_row[row] = (
                    np.where(given, from_grid(labels, series[row]), np.nan),
                    np.where(given, from_grid(error, series[row]), np.nan),
                )
        return [by_row[row] for row in range(len(series))]

    def person(self, person: str) -> KnownStyle:
        """The calibrated style of a person.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return lookup_person(self._people, self.name, person)

    def teacher_style(self, person: str) -> dict[str, float]:
        """Gain, delay and more as a simulated teacher would have them, by ``teachers.STYLE``.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        readout = self._model.style_readout
        values = readout[0] + self.person(person).style[0] @ readout[1:]
        return dict(zip(STYLE, values.tolist(), strict=True))

    def is_unlike(self, person: str) -> bool:
        """Whether a person's labels, or truths, are unlike any that pre-training has seen.

        That is: two or more entries of w lie beyond four standard deviations of the simulated
        people's, where they are cut off.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        style = np.delete(self.person(person).style[0], HOW_MANY)
        return bool((np.abs(style) >= LARGEST).sum() >= _UNLIKE)

    @property
    def error_scale(self) -> ErrorScale:
        """The training people's actual errors compared with the stated ones.

        Raises:
            NotFitted: ``fit`` was not called, or with a single rollout a person.
        """
        if self._error_scale is None:
            raise NotFitted(
                f"{self.name} has measured no errors, so it can expect none; call fit with two or "
                "more rollouts of someone first. map needs no errors."
            )
        return self._error_scale

    @property
    def is_fine_tuned(self) -> bool:
        """Whether ``fit`` found fine-tuning to help."""
        return self._network is not self._model.network

    @property
    def fine_tuning_gain(self) -> float:
        """Share of the frozen network's error that fine-tuning took away on held-out rollouts."""
        return self._gain

    @property
    def correction_share(self) -> float:
        """The share of the network's correction that counts, as the training people have it."""
        return self._correction_share

    @property
    def people(self) -> tuple[str, ...]:
        """The people who can be mapped, fitted or calibrated."""
        return tuple(self._people)
