"""Label mappers: the protocol of every mapper, and MIND MELD as one."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.calibration import CalibratedPeople, calibrate, encode, spread_rows
from steerlab.learning.certainty import Calibrated, TrainingPeople
from steerlab.learning.errors import NotFitted, UnknownPerson
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.series import LabelSeries, by_person, lookup_person
from steerlab.learning.training import torch_threads, train
from steerlab.learning.windows import Windows, make_windows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

WINDOWS_PER_PERSON = 600  # more of them calibrate no better (docs/mapper-experiments.md)
_PEOPLE_AT_ONCE = 16  # whoever is done leaves the group early
_WORKERS = 2  # groups share nothing, so their number changes no result


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
        name: its key among the baselines.
    """

    def __init__(
        self,
        config: MapperConfig = LAB,
        *,
        seed: int,
        on_epoch: Callable[[int, int], None] | None = None,
        name: str = "mind_meld",
    ) -> None:
        self.name = name
        self.config = config
        self.seed = seed
        self._on_epoch = on_epoch
        self._network: MindMeld | None = None
        self._mean_embedding: Tensor | None = None
        self._embeddings: dict[str, Tensor] = {}
        self._training_embeddings: Tensor | None = None
        self._calibrated: dict[str, Calibrated] = {}
        self._history: tuple[tuple[float, float], ...] = ()

    @classmethod
    def from_trained(
        cls,
        config: MapperConfig,
        seed: int,
        network: MindMeld,
        training_embeddings: Tensor,
        embeddings: dict[str, Tensor],
        calibrated: dict[str, Calibrated],
    ) -> "MindMeldMapper":
        """A fitted mapper from its parts, as a checkpoint holds them."""
        mapper = cls(config, seed=seed)
        mapper._network = network.requires_grad_(False)
        mapper._training_embeddings = training_embeddings
        mapper._embeddings = dict(embeddings)
        mapper._calibrated = dict(calibrated)
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
        self._training_embeddings = trained.embeddings
        self._embeddings = dict(zip(windows.people, trained.embeddings, strict=True))
        self._calibrated = {}
        self._history = trained.history

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the embeddings of the people in ``series``, the network frozen.

        Someone known already gets a new embedding. Of long recordings ``WINDOWS_PER_PERSON``
        windows are used, evenly spread.

        Raises:
            NotFitted: ``fit`` was not called.
            InvalidLabels: no series, or someone without a valid step.
        """
        network, mean = self.network, self.mean_embedding
        people = list(by_person(series).values()) or [[]]
        groups = [
            list(chain.from_iterable(people[start : start + _PEOPLE_AT_ONCE]))
            for start in range(0, len(people), _PEOPLE_AT_ONCE)
        ]

        def calibrate_group(group: list[LabelSeries]) -> tuple[tuple[str, ...], CalibratedPeople]:
            rows = spread_rows(group, WINDOWS_PER_PERSON) if group else None
            windows = make_windows(group, self.config.window, rows)
            with torch_threads(1):  # a thread of Python's has its own count
                weight = self.config.training.embedding_loss_weight
                return windows.people, calibrate(network, windows, mean, weight)

        with ThreadPoolExecutor(max_workers=_WORKERS) as pool:
            for names, calibrated in pool.map(calibrate_group, groups):
                self._keep(names, calibrated)

    def _keep(self, people: tuple[str, ...], calibrated: CalibratedPeople) -> None:
        training = TrainingPeople.of(self.training_embeddings.double().numpy())
        for index, person in enumerate(people):
            self._embeddings[person] = calibrated.embeddings[index]
            self._calibrated[person] = training.judge(
                person,
                calibrated.embeddings[index].double().numpy(),
                calibrated.information[index].numpy(),
                calibrated.g_sigma[index].double().numpy(),
            )

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted: ``fit`` was not called.
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return self.map_with(self.embedding_tensor(series.person), series)

    def map_with(self, embedding: Tensor, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,) as if the person's embedding were ``embedding``, (d,)."""
        return map_windows(self.network, make_windows([series], self.config.window), embedding)

    def embedding(self, person: str) -> FloatArray:
        """The person's w, shape (d,).

        Raises:
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return self.embedding_tensor(person).numpy().astype(np.float64)

    def embedding_tensor(self, person: str) -> Tensor:
        """The person's w as the network takes it, (d,) float32."""
        return lookup_person(self._embeddings, self.name, person)

    def calibration(self, person: str) -> Calibrated:
        """How sure a new person's embedding is, and whether they are unlike the training people.

        Raises:
            UnknownPerson: the person was not calibrated; those fitted have no such record.
        """
        if person not in self._calibrated:
            raise UnknownPerson(
                f"{self.name} has not calibrated {person!r}; call calibrate with their "
                "calibration series."
            )
        return self._calibrated[person]

    @property
    def calibrated(self) -> tuple[str, ...]:
        """The people who have a ``calibration``."""
        return tuple(self._calibrated)

    @property
    def people(self) -> tuple[str, ...]:
        """The people who can be mapped, fitted or calibrated."""
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
    def training_embeddings(self) -> Tensor:
        """The training people's embeddings as training left them, (people, d).

        Raises:
            NotFitted: ``fit`` was not called.
        """
        if self._training_embeddings is None:
            raise NotFitted(f"{self.name} is not trained; call fit, or load a checkpoint.")
        return self._training_embeddings

    @property
    def mean_embedding(self) -> Tensor:
        """The mean of the training people's embeddings, (d,): where calibration starts.

        Raises:
            NotFitted: ``fit`` was not called.
        """
        return self.training_embeddings.mean(dim=0)


def map_windows(network: MindMeld, windows: Windows, embedding: Tensor) -> FloatArray:
    """Mapped labels of every row, (rows,), all with the same embedding (d,); clamped."""
    with torch.no_grad(), torch_threads(1):  # too little work to share between threads
        encoding = encode(network, windows.inputs)
        difference = network.difference(encoding, embedding.expand(len(encoding), -1))
    mapped = windows.label.double().numpy() - difference.double().numpy()
    return np.clip(mapped, -WHEEL_LIMIT, WHEEL_LIMIT)


def stack_embeddings(mapper: MindMeldMapper, people: Sequence[str]) -> FloatArray:
    """Embeddings of several people, (people, d)."""
    return np.stack([mapper.embedding(person) for person in people])
