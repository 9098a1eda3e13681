"""What corrects labels: the contract of every mapper, and MIND MELD as one."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.calibration import calibrate, encode
from steerlab.learning.errors import NotFitted, UnknownPerson
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads, train
from steerlab.learning.windows import make_windows
from steerlab.sim.rollout import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class LabelMapper(Protocol):
    """Turns a person's labels into labels closer to the ground truth."""

    name: str

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Learn from the training people's labels and truth."""
        ...

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Add new people from their calibration labels and truth; what was fitted stays."""
        ...

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,) within ±``WHEEL_LIMIT``; NaN where there was no label.

        The truth of ``series`` is never read.
        """
        ...


class MindMeldMapper:
    """MIND MELD: mapped = a - f(E(window), w), clamped (paper, section Methodology).

    Args:
        config: a preset (``LAB``, ``PAPER``) or one's own.
        seed: of weights, embeddings and batches.
        on_epoch: called with (epochs done, epochs) while fitting.
    """

    name = "mind_meld"

    def __init__(
        self,
        config: MapperConfig = LAB,
        *,
        seed: int,
        on_epoch: Callable[[int, int], None] | None = None,
    ) -> None:
        self.config = config
        self.seed = seed
        self._on_epoch = on_epoch
        self._network: MindMeld | None = None
        self._mean_embedding: Tensor | None = None
        self._embeddings: dict[str, Tensor] = {}
        self._history: tuple[tuple[float, float], ...] = ()

    @classmethod
    def from_trained(
        cls,
        config: MapperConfig,
        seed: int,
        network: MindMeld,
        mean_embedding: Tensor,
        embeddings: dict[str, Tensor],
    ) -> "MindMeldMapper":
        """A fitted mapper from its parts, as a checkpoint holds them."""
        mapper = cls(config, seed=seed)
        mapper._network = network.requires_grad_(False)
        mapper._mean_embedding = mean_embedding
        mapper._embeddings = dict(embeddings)
        return mapper

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train network and embeddings; forgets whatever was fitted or calibrated before.

        Raises:
            InvalidLabels: no series, or someone without a valid step.
        """
        windows = make_windows(series, self.config.window)
        trained = train(
            windows, self.config.network, self.config.training, self.seed, self._on_epoch
        )
        self._network = trained.network
        self._mean_embedding = trained.embeddings.mean(dim=0)
        self._embeddings = dict(zip(windows.people, trained.embeddings, strict=True))
        self._history = trained.history

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the embeddings of the people in ``series``, the network frozen.

        Someone known already gets a new embedding.

        Raises:
            NotFitted: ``fit`` was not called.
            InvalidLabels: no series, or someone without a valid step.
        """
        windows = make_windows(series, self.config.window)
        with torch_threads(self.config.training.threads):
            embeddings = calibrate(
                self.network,
                windows,
                self.mean_embedding,
                self.config.training.embedding_loss_weight,
            )
        self._embeddings |= dict(zip(windows.people, embeddings, strict=True))

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: ``fit`` was not called.
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return self.map_with(self.embedding_tensor(series.person), series)

    def map_with(self, embedding: Tensor, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,) as if the person's embedding were ``embedding``, (d,)."""
        windows = make_windows([series], self.config.window)
        with torch.no_grad(), torch_threads(1):  # too little work to share between threads
            encoding = encode(self.network, windows.inputs)
            difference = self.network.difference(encoding, embedding.expand(len(encoding), -1))
        mapped = series.label - difference.numpy().astype(np.float64)
        return np.clip(mapped, -WHEEL_LIMIT, WHEEL_LIMIT)

    def embedding(self, person: str) -> FloatArray:
        """The person's w, shape (d,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return self.embedding_tensor(person).numpy().astype(np.float64)

    def embedding_tensor(self, person: str) -> Tensor:
        """The person's w as the network takes it, (d,) float32."""
        if person not in self._embeddings:
            raise UnknownPerson(
                f"{self.name} does not know {person!r}; it knows {self._known()}. "
                "Call calibrate with their calibration series first."
            )
        return self._embeddings[person]

    @property
    def people(self) -> tuple[str, ...]:
        """Everyone who can be mapped, fitted or calibrated."""
        return tuple(self._embeddings)

    @property
    def history(self) -> tuple[tuple[float, float], ...]:
        """Mean (difference, embedding) loss of each epoch of ``fit``; empty when loaded."""
        return self._history

    @property
    def network(self) -> MindMeld:
        """The trained network.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        if self._network is None:
            raise NotFitted(f"{self.name} is not trained; call fit, or load a checkpoint.")
        return self._network

    @property
    def mean_embedding(self) -> Tensor:
        """The mean of the training people's embeddings, (d,): where calibration starts.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        if self._mean_embedding is None:
            raise NotFitted(f"{self.name} is not trained; call fit, or load a checkpoint.")
        return self._mean_embedding

    def _known(self) -> str:
        names = list(self._embeddings)
        shown = ", ".join(names[:5]) or "no one"
        return f"{shown} and {len(names) - 5} more" if len(names) > 5 else shown


def stack_embeddings(mapper: MindMeldMapper, people: Sequence[str]) -> FloatArray:
    """Embeddings of several people, (people, d)."""
    return np.stack([mapper.embedding(person) for person in people])
