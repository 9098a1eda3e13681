"""MIND MELD with an embedding that is not the person's own: what does w itself contribute?"""

from collections.abc import Sequence

import torch
from torch import Tensor

from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray


class MeanEmbeddingMapper:
    """MIND MELD's network with everyone's w replaced by the training people's mean.

    Shares the network it is given: a fitted one needs no second ``fit``.
    """

    name = "mean_embedding"

    def __init__(self, mind_meld: MindMeldMapper) -> None:
        self._mind_meld = mind_meld

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the shared network."""
        self._mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Nothing to learn: everyone is the mean."""

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: the shared network is not trained.
        """
        return self._mind_meld.map_with(self._mind_meld.mean_embedding, series)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """The mean for each of ``people``, (people, d)."""
        return self._mind_meld.mean_embedding.expand(len(people), -1)

    @property
    def mind_meld(self) -> MindMeldMapper:
        """Whose network it shares."""
        return self._mind_meld


class ShuffledEmbeddingMapper:
    """MIND MELD's network with each person given the w of the next one, and the last the first's.

    The order is that in which the mapper met the people; it says nothing of their styles. Nobody
    keeps their own w. Shares the network and embeddings it is given.
    """

    name = "shuffled_embedding"

    def __init__(self, mind_meld: MindMeldMapper) -> None:
        self._mind_meld = mind_meld

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train the shared network."""
        self._mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Calibrate the shared mapper."""
        self._mind_meld.calibrate(series)

    def lender(self, person: str) -> str:
        """Whose w the person is given.

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
            InvalidLabels: the mapper knows nobody else.
        """
        lenders = self._lenders()
        if person not in lenders:
            raise UnknownPerson(f"{self.name} does not know {person!r}; call calibrate first.")
        if len(lenders) < 2:
            raise InvalidLabels(f"{self.name} knows {person!r} alone; a shuffle needs two people.")
        return lenders[person]

    def _lenders(self) -> dict[str, str]:
        people = self._mind_meld.people
        return dict(zip(people, (*people[1:], *people[:1]), strict=True))

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        lent = self._mind_meld.embedding_tensor(self.lender(series.person))
        return self._mind_meld.map_with(lent, series)

    def embeddings(self, people: Sequence[str]) -> Tensor:
        """The lender's w for each of ``people``, (people, d).

        Raises:
            UnknownPerson: someone was neither fitted nor calibrated.
        """
        lenders = self._lenders()
        if unknown := [person for person in people if person not in lenders]:
            raise UnknownPerson(f"{self.name} does not know {unknown[0]!r}; call calibrate first.")
        return torch.stack([self._mind_meld.embedding_tensor(lenders[one]) for one in people])

    @property
    def mind_meld(self) -> MindMeldMapper:
        """Whose network it shares."""
        return self._mind_meld
