"""Labels mapped while they arrive: causal, or a fixed look-ahead behind."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.certainty import Calibrated
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads
from steerlab.learning.windows import WindowConfig, window_offsets
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT


class StreamingMapper:
    """MIND MELD trained on windows that end ``look_ahead_s`` after the label they improve.

    Args:
        look_ahead_s: how long a label may be waited for; 0 is causal. Shorter costs improvement
            (``benchmarks/mapper_quality.py --full``).
        config: as for MIND MELD.
        seed: of weights, embeddings and batches.
        on_epoch: called with (epochs done, epochs) while fitting.

    Raises:
        InvalidConfig: the look-ahead is negative or beyond the window.
    """

    def __init__(
        self,
        look_ahead_s: float,
        config: MapperConfig = LAB,
        *,
        seed: int,
        on_epoch: Callable[[int, int], None] | None = None,
    ) -> None:
        self.name = "mind_meld_causal" if look_ahead_s == 0.0 else f"mind_meld_{look_ahead_s:g}_s"
        window = replace(config.window, look_ahead_s=look_ahead_s)
        self._mind_meld = MindMeldMapper(
            replace(config, window=window), seed=seed, on_epoch=on_epoch, name=self.name
        )

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Train network and embeddings; see ``MindMeldMapper.fit``."""
        self._mind_meld.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Fit the embeddings of new people; see ``MindMeldMapper.calibrate``."""
        self._mind_meld.calibrate(series)

    def calibration(self, person: str) -> Calibrated:
        """How sure a new person's embedding is."""
        return self._mind_meld.calibration(person)

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,) of a whole rollout: what a stream of it would have given.

        Raises:
            NotFitted: ``fit`` was not called.
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        return self._mind_meld.map(series)

    def stream(self, person: str, rate_hz: float) -> "LabelStream":
        """An empty stream of one person's labels at a control rate; one stream per rollout.

        Raises:
            NotFitted: ``fit`` was not called.
            UnknownPerson: the person was neither fitted nor calibrated.
        """
        mind_meld = self._mind_meld
        embedding = mind_meld.embedding_tensor(person)
        return LabelStream(mind_meld.network, mind_meld.config.window, embedding, rate_hz)


class LabelStream:
    """One rollout's labels, pushed step by step.

    Attributes:
        delay_steps: how many steps a mapped label is behind the pushed one.

    Raises:
        InvalidLabels: ``rate_hz`` is not positive.
    """

    def __init__(
        self, network: MindMeld, window: WindowConfig, embedding: Tensor, rate_hz: float
    ) -> None:
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise InvalidLabels(f"rate_hz is {rate_hz}; it must be positive.")
        self._network, self._embedding = network, embedding[None]
        below, fraction = window_offsets(rate_hz, window)
        shown = slice(0, window.side + window.ahead + 1)  # the rest stays absent
        self._below, self._fraction = below[shown], fraction[shown]
        above = self._below + (self._fraction > 0.0)
        self.delay_steps = max(0, int(above.max()))
        self._past = int(-self._below.min())
        self._lower, self._upper = self._below + self._past, above + self._past
        size = self._past + 1 + self.delay_steps
        self._labels = deque([nan] * size, maxlen=size)
        self._inputs = torch.zeros(1, window.length, 2)
        self._shown = self._inputs[0].numpy()[shown]
        self._pushed = 0

    def push(self, label: float | None) -> float | None:
        """Take the label of the next step; give the mapped one of ``delay_steps`` ago.

        Args:
            label: in wheel units; None where none was given.

        Returns:
            None before the first mapped label is due; NaN for a step without a label.

        Raises:
            InvalidLabels: the label is beyond the wheel.
        """
        value = nan if label is None else label
        if abs(value) > WHEEL_LIMIT + 1e-6:
            raise InvalidLabels(
                f"Label {value:g} is outside ±{WHEEL_LIMIT}; scale the wheel before it is pushed."
            )
        self._labels.append(value)
        self._pushed += 1
        return self._mapped() if self._pushed > self.delay_steps else None

    def finish(self) -> list[float]:
        """The labels still due at the end of the rollout, whose look-ahead stays empty."""
        due = min(self.delay_steps, self._pushed)
        missing = self.delay_steps - due  # a rollout shorter than the look-ahead
        self._labels.extend([nan] * missing)
        mapped: list[float] = []
        for _ in range(due):
            self._labels.append(nan)
            mapped.append(self._mapped())
        self._pushed = 0
        self._labels.extend([nan] * len(self._labels))
        return mapped

    def _mapped(self) -> float:
        labels = np.array(self._labels)
        lower, upper = labels[self._lower], labels[self._upper]
        sample = lower + self._fraction * (upper - lower)
        present = np.isfinite(sample)
        self._shown[:, 0] = np.where(present, sample, 0.0)
        self._shown[:, 1] = present
        with torch.no_grad(), torch_threads(1):
            encoding = self._network.encoder(self._inputs)
            difference = self._network.difference(encoding, self._embedding).item()
        # As the batch does: label and difference as float32, the subtraction as float64.
        label = float(np.float32(labels[self._past]))
        return float(np.clip(label - difference, -WHEEL_LIMIT, WHEEL_LIMIT))
