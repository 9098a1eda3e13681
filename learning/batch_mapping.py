"""Maps many series at once: the same labels as one by one, and much faster."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.baselines.ablations import (
    MeanEmbeddingMapper,
    NoEmbeddingMapper,
    ShuffledEmbeddingMapper,
    TrueStyleMapper,
)
from steerlab.learning.baselines.auto import AutoMapper
from steerlab.learning.calibration import encode
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads
from steerlab.learning.windows import WindowConfig, Windows, make_windows
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

_STEPS_AT_ONCE = 50_000  # 8 MB of windows, some 80 MB while they are cut


def map_in_chunks(
    mappers: Mapping[str, LabelMapper], series: Sequence[LabelSeries]
) -> Iterator[tuple[list[LabelSeries], dict[str, list[FloatArray]]]]:
    """Yield chunks of ``series``, and each mapper's labels for them as ``map`` gives, but rounding.

    A caller that needs each chunk only briefly can drop it before the next is mapped.
    """
    for chunk in _chunks(series):
        windows = _SharedWindows(chunk)
        mapped = {
            name: _map(mapper, windows)
            for name, mapper in mappers.items()
            if not isinstance(mapper, AutoMapper)
        }
        for name, mapper in mappers.items():
            if isinstance(mapper, AutoMapper):
                parts = {
                    one: mapped.get(one) or _map(by, windows) for one, by in mapper.mappers.items()
                }
                mapped[name] = [
                    mapper.blend({one: parts[one][row] for one in parts})
                    for row in range(len(chunk))
                ]
        yield chunk, mapped


class _SharedWindows:
    """Windows and encodings of a few series; mappers that share a network share the encoding."""

    def __init__(self, series: list[LabelSeries]) -> None:
        self.series = series
        self._windows: dict[WindowConfig, Windows] = {}
        self._encodings: dict[tuple[int, WindowConfig], Tensor] = {}

    def windows(self, config: WindowConfig) -> Windows:
        if config not in self._windows:
            self._windows[config] = make_windows(self.series, config)
        return self._windows[config]

    def encoding(self, mapper: MindMeldMapper | NoEmbeddingMapper | TrueStyleMapper) -> Tensor:
        key = (id(mapper.network), mapper.config.window)
        if key not in self._encodings:
            inputs = self.windows(mapper.config.window).inputs
            self._encodings[key] = encode(mapper.network, inputs)
        return self._encodings[key]


def _map(mapper: LabelMapper, shared: _SharedWindows) -> list[FloatArray]:
    match mapper:
        case MindMeldMapper():
            return _by_network(mapper, mapper, shared)
        case MeanEmbeddingMapper() | ShuffledEmbeddingMapper():
            return _by_network(mapper.mind_meld, mapper, shared)
        case NoEmbeddingMapper() | TrueStyleMapper():
            return _by_network(mapper, mapper, shared)
        case SimPretrainedMapper():
            return mapper.map_many(shared.series)
        case _:
            return [mapper.map(drive) for drive in shared.series]


def _by_network(
    trained: MindMeldMapper | NoEmbeddingMapper | TrueStyleMapper,
    embedding: MindMeldMapper
    | MeanEmbeddingMapper
    | ShuffledEmbeddingMapper
    | NoEmbeddingMapper
    | TrueStyleMapper,
    shared: _SharedWindows,
) -> list[FloatArray]:
    """Mapped labels by the network of ``trained`` with the embeddings of ``embedding``."""
    windows = shared.windows(trained.config.window)
    if isinstance(embedding, MindMeldMapper):
        w = torch.stack([embedding.embedding_tensor(person) for person in windows.people])
    else:
        w = embedding.embeddings(windows.people)
    with torch.no_grad(), torch_threads(1):
        difference = trained.network.difference(shared.encoding(trained), w[windows.person])
    label = np.concatenate([drive.label for drive in shared.series])
    mapped = np.clip(label - difference.numpy().astype(np.float64), -WHEEL_LIMIT, WHEEL_LIMIT)
    return np.split(mapped, np.cumsum([drive.steps for drive in shared.series])[:-1])


def _chunks(series: Sequence[LabelSeries]) -> Iterator[list[LabelSeries]]:
    """Lists of about ``_STEPS_AT_ONCE`` steps, never empty."""
    chunk: list[LabelSeries] = []
    steps = 0
    for drive in series:
        chunk.append(drive)
        steps += drive.steps
        if steps >= _STEPS_AT_ONCE:
            yield chunk
            chunk, steps = [], 0
    if chunk:
        yield chunk
