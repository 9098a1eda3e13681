"""``SimPretrainedMapper``: a network taught by simulated teachers, calibrated in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.empirical_bayes.grid import GridSeries, from_grid, grid_positions
from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.learning.pretrained.fine_tuning import (
    FineTuningConfig,
    fine_tuned,
    study_batch,
)
from steerlab.learning.pretrained.model import PretrainedModel, map_labels
from steerlab.learning.pretrained.style import StyleMoments, concatenate, style_moments
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.learning.pretrained.weights import load_shipped_model
from steerlab.learning.series import CONTEXT, LabelSeries
from steerlab.learning.training import torch_threads
from steerlab.sim.rollout import FloatArray

FINE_TUNING = FineTuningConfig()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PersonStyle:
    """What calibration leaves of a person: coefficients of the closed form, and w."""

    coefficients: FloatArray
    style: FloatArray


class SimPretrainedMapper:
    """Shipped weights; a person's style is found in closed form.

    The network stays frozen unless fine-tuning on the training people helps on rollouts of theirs
    that were held out for the choice. Not a method of the paper and shown on simulated teachers
    only; MIND MELD stays beside it.

    Args:
        context: also read the car's own motion, which every series must then carry.
        model: in place of the shipped weights.
        fine_tuning: how to fine-tune; None keeps the network frozen and ``fit`` in milliseconds.
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
        self._people: dict[str, PersonStyle] = {}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Calibrate the training people and choose the network; forgets everything before.

        Raises:
            InvalidLabels: no series, or someone without a valid label.
        """
        self._people, self._network, self._gain = {}, self._model.network, 0.0
        self.calibrate(series)
        if self._fine_tuning is not None:
            motions = [motion_on_grid(one) for one in series] if self._context else None
            batch = study_batch(self._model, series, motions)
            self._network, self._gain = fine_tuned(
                self._model, batch, self._seed, self._fine_tuning
            )

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """The style of the people in ``series``; someone known gets a new one.

        Raises:
            InvalidLabels: no series, or someone without a valid label.
        """
        people, moments = person_moments(series)
        coefficients, styles = self._model.encoder(moments)
        self._people |= {
            person: PersonStyle(coefficients=coefficients[row], style=styles[row])
            for row, person in enumerate(people)
        }

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        return self.map_with_spread(series)[0]

    def map_with_spread(self, series: LabelSeries) -> tuple[FloatArray, FloatArray]:
        """Mapped labels and the absolute error to expect of each, (steps,) both.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the car's motion is wanted and missing.
        """
        person = self.person(series.person)
        grid = GridSeries.from_series(series)
        with torch_threads(1):  # too little work to share between threads
            mapped, spread = map_labels(
                self._network,
                self._model.style_readout,
                person.coefficients[None],
                person.style[None],
                grid.label[None],
                grid.present[None],
                self._motion(series),
            )
        given = np.isfinite(series.label)
        return (
            np.where(given, from_grid(mapped[0], series), np.nan),
            np.where(given, from_grid(spread[0], series), np.nan),
        )

    def person(self, person: str) -> PersonStyle:
        """What is known of someone.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        if person not in self._people:
            names = ", ".join(list(self._people)[:5]) or "no one"
            raise UnknownPerson(
                f"{self.name} does not know {person!r}; it knows {names}. "
                "Call calibrate with their calibration series first."
            )
        return self._people[person]

    def teacher_style(self, person: str) -> dict[str, float]:
        """Gain, delay and more as a simulated teacher would have them, by ``teachers.STYLE``.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        readout = self._model.style_readout
        values = readout[0] + self.person(person).style @ readout[1:]
        return dict(zip(STYLE, values.tolist(), strict=True))

    @property
    def is_fine_tuned(self) -> bool:
        """Whether ``fit`` found fine-tuning to help."""
        return self._network is not self._model.network

    @property
    def fine_tuning_gain(self) -> float:
        """Share of the frozen network's error that fine-tuning took away on held-out rollouts."""
        return self._gain

    @property
    def people(self) -> tuple[str, ...]:
        """Everyone who can be mapped, fitted or calibrated."""
        return tuple(self._people)

    def _motion(self, series: LabelSeries) -> FloatArray | None:
        return motion_on_grid(series)[None] if self._context else None


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
    parts: list[StyleMoments] = []
    for one in series:
        grid = GridSeries.from_series(one)
        parts.append(style_moments(grid.label[None], grid.truth[None], grid.valid[None]))
    people = tuple(dict.fromkeys(one.person for one in series))
    weights = np.array([[one.person == person for one in series] for person in people])
    moments = concatenate(parts).grouped(weights.astype(np.float64))
    for person, rows in zip(people, moments.inverse.rows, strict=True):
        if rows == 0.0:
            raise InvalidLabels(f"{person!r} has no valid label to calibrate on; label a rollout.")
    return people, moments
