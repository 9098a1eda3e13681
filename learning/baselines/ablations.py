"""MIND MELD with other embeddings: what does w contribute, and what would the true style give?

Two mappers share a trained MIND MELD and give people another w than their own; two train the same
network with embeddings that are given, not learned.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels, NotFitted, UnknownPerson
from steerlab.learning.mapper import MindMeldMapper, map_windows
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.series import LabelSeries, lookup_person
from steerlab.learning.training import train
from steerlab.learning.windows import make_windows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.scripted_teacher import TeacherStyle


class MeanEmbeddingMapper:
    """MIND MELD's network with everyone's w replaced by the training people's mean.

    Shares the network it is given: a fitted one needs no second ``fit``.
    """

    name = "mean_embedding"

    def __init__(self, mind_meld: MindMeldMapper) -> None:
        self.mind_meld = mind_meld

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the shared network."""
        self.mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone is the mean."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: the shared network is not trained.
        """
        return self.mind_meld.map_with(self.mind_meld.mean_embedding, series)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """The mean for each of ``people``, (people, d)."""
        return self.mind_meld.mean_embedding.expand(len(people), -1)


class ShuffledEmbeddingMapper:
    """MIND MELD's network with each person given the w of the next one, and the last the first's.

    The order is that in which the mapper met the people; it says nothing of their styles. Nobody
    keeps their own w. Shares the network and embeddings it is given.
    """

    name = "shuffled_embedding"

    def __init__(self, mind_meld: MindMeldMapper) -> None:
        self.mind_meld = mind_meld

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the shared network."""
        self.mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Calibrate the shared mapper."""
        self.mind_meld.calibrate(series)

    def lender(self, person: str) -> str:
        """The person whose w this person is given.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the mapper knows nobody else.
        """
        lenders = self._lenders()
        lender = lookup_person(lenders, self.name, person)
        if len(lenders) < 2:
            raise InvalidLabels(f"{self.name} knows {person!r} alone; a shuffle needs two people.")
        return lender

    def _lenders(self) -> dict[str, str]:
        people = self.mind_meld.people
        return dict(zip(people, (*people[1:], *people[:1]), strict=True))

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        lent = self.mind_meld.embedding_tensor(self.lender(series.person))
        return self.mind_meld.map_with(lent, series)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """The lender's w for each of ``people``, (people, d).

        Raises:
            UnknownPerson: someone was neither fitted nor calibrated.
        """
        lenders = self._lenders()
        lent_by = [lookup_person(lenders, self.name, person) for person in people]
        return torch.stack([self.mind_meld.embedding_tensor(lender) for lender in lent_by])


class NoEmbeddingMapper:
    """The same network, window and training with w held at 0 for everybody: one map for all.

    Args:
        config: as for MIND MELD; nothing is inferred of w, so lambda is 0.
        seed: of weights and batches.
        on_epoch: called with (epochs done, epochs) while fitting.
    """

    name = "no_embedding"

    def __init__(
        self,
        config: MapperConfig = LAB,
        *,
        seed: int,
        on_epoch: Callable[[int, int], None] | None = None,
    ) -> None:
        self.config, self._seed, self._on_epoch = config, seed, on_epoch
        self._network: MindMeld | None = None

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the network.

        Raises:
            InvalidLabels: no series, or someone without a valid step.
        """
        self._network = _train(
            series, self.config, self._seed, self._on_epoch, lambda person, mirrored: self._w
        )

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone's w is 0."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: ``fit`` was not called.
        """
        return map_windows(self.network, make_windows([series], self.config.window), self._w)

    @property
    def network(self) -> MindMeld:
        """The trained network.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        return _trained(self._network, self.name)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """0 for each of ``people``, (people, d)."""
        return self._w.expand(len(people), -1)

    @property
    def _w(self) -> Tensor:
        return torch.zeros(self.config.network.embedding_size)


class TrueStyleMapper:
    """A reference, not a method: w is the teacher's true style, for seen and for new people.

    What the same network reaches when nothing has to be inferred; an estimate of the ceiling.
    Style parameters are standardised over the people it is fitted on.

    Args:
        styles: of everyone who will be mapped.
        config: as for MIND MELD; w has a dimension for each parameter, and lambda is 0.
        seed: of weights and batches.
        on_epoch: called with (epochs done, epochs) while fitting.
    """

    name = "true_style"

    def __init__(
        self,
        styles: Mapping[str, TeacherStyle],
        config: MapperConfig = LAB,
        *,
        seed: int,
        on_epoch: Callable[[int, int], None] | None = None,
    ) -> None:
        self._styles = dict(styles)
        names = [field.name for field in fields(TeacherStyle)]
        if not any(style.tolerance for style in styles.values()):
            names.remove("tolerance")  # w is no larger, and its network no other, where all correct
        self._parameters, size = tuple(names), len(names)
        self.config = replace(config, network=replace(config.network, embedding_size=size))
        self._seed, self._on_epoch = seed, on_epoch
        self._network: MindMeld | None = None
        self._centre, self._scale = np.zeros(size), np.ones(size)

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the network on the true styles.

        Raises:
            UnknownPerson: someone's style was not given.
            InvalidLabels: no series, or someone without a valid step.
        """
        people = dict.fromkeys(drive.person for drive in series)
        styles = np.stack([self._vector(self._style(person)) for person in people])
        self._centre, spread = styles.mean(axis=0), styles.std(axis=0)
        self._scale = np.where(
            spread > 0.0, spread, np.inf
        )  # a parameter in which nobody differs tells nothing, of new people neither
        self._network = _train(series, self.config, self._seed, self._on_epoch, self._w)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: new people's styles are given as well."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: ``fit`` was not called.
            UnknownPerson: the person's style was not given.
        """
        w = self._w(series.person)
        return map_windows(self.network, make_windows([series], self.config.window), w)

    @property
    def network(self) -> MindMeld:
        """The trained network.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        return _trained(self._network, self.name)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """The true style of each of ``people`` as the network takes it, (people, d).

        Raises:
            UnknownPerson: someone's style was not given.
        """
        return torch.stack([self._w(person) for person in people])

    def _style(self, person: str) -> TeacherStyle:
        if person not in self._styles:
            raise UnknownPerson(f"{self.name} was not given the style of {person!r}; add it.")
        return self._styles[person]

    def _w(self, person: str, mirrored: bool = False) -> Tensor:
        style = self._style(person)
        if mirrored:  # the bias is all that tells left from right
            style = replace(style, bias=-style.bias)
        standardised = (self._vector(style) - self._centre) / self._scale
        return torch.from_numpy(standardised.astype(np.float32))

    def _vector(self, style: TeacherStyle) -> FloatArray:
        """Every parameter of a style, the gain as its logarithm, (parameters,)."""
        values = {**vars(style), "gain": np.log(style.gain)}
        return np.array([values[name] for name in self._parameters], dtype=np.float64)


def _train(
    series: Sequence[LabelSeries],
    config: MapperConfig,
    seed: int,
    on_epoch: Callable[[int, int], None] | None,
    embedding: Callable[[str, bool], Tensor],
) -> MindMeld:
    windows = make_windows(series, config.window)
    images = (False, True) if config.training.mirror else (False,)
    given = torch.stack(
        [embedding(person, mirrored) for mirrored in images for person in windows.people]
    )
    training = replace(config.training, embedding_loss_weight=0.0)
    return train(windows, config.network, training, seed, on_epoch, given=given).network


def _trained(network: MindMeld | None, name: str) -> MindMeld:
    if network is None:
        raise NotFitted(f"{name} is not trained; call fit.")
    return network
