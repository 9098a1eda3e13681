"""Windows trained on a second: ours and ``plain_mind_meld.py``, batches of the same size.

Each side has a process of its own, as whoever runs one of them has: within one process the faster
side leaves the allocator in a state in which the other's large buffers cost less. Plain PyTorch is
given one thread and torch's default for the machine; the faster counts.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import get_context
from statistics import median
from time import perf_counter

import torch

from benchmarks.plain_mind_meld import PlainWindows, train_plain
from steerlab.learning.presets import LAB
from steerlab.learning.series import LabelSeries
from steerlab.learning.training import torch_threads, train
from steerlab.learning.windows import WindowConfig, make_windows

ROUNDS = 3  # the sides take turns
REPEATS = 3
PLAIN_BATCHES = 24
OUR_EPOCHS = 24  # of 18 batches; a study's training has ten times as many


@dataclass(frozen=True, kw_only=True)
class TrainingRates:
    """Windows a second.

    Attributes:
        ours: by number of threads, one and two.
        plain: by number of torch's threads, one and the default.
    """

    ours: dict[int, float]
    plain: dict[int, float]

    @property
    def best_plain(self) -> float:
        """What ours is compared with."""
        return max(self.plain.values())


def training_rates(series: list[LabelSeries], people: int) -> TrainingRates:
    """Measure both sides in turns, a fresh process each time."""
    sides: dict[tuple[bool, int], list[float]] = {}
    for _ in range(ROUNDS):
        for plain, threads in (
            (True, 1), (False, 1), (True, torch.get_num_threads()), (False, 2)
        ):  # fmt: skip
            with get_context("spawn").Pool(1) as pool:
                rate = pool.apply(_plain_rate if plain else _our_rate, (series, people, threads))
            sides.setdefault((plain, threads), []).append(rate)
    return TrainingRates(
        ours={threads: median(rates) for (plain, threads), rates in sides.items() if not plain},
        plain={threads: median(rates) for (plain, threads), rates in sides.items() if plain},
    )


def _our_rate(series: list[LabelSeries], people: int, threads: int) -> float:
    windows = make_windows(series, WindowConfig())
    config = replace(LAB.training, epochs=OUR_EPOCHS, least_per_epoch=1, threads=threads)
    per_epoch = round(config.share_per_epoch * int(windows.valid.sum()))

    def job() -> int:
        train(windows, LAB.network, config, seed=0)
        return config.epochs * per_epoch

    return _rate(job)


def _plain_rate(series: list[LabelSeries], people: int, threads: int) -> float:
    data = PlainWindows(series)
    with torch_threads(threads):
        return _rate(lambda: train_plain(data, people, PLAIN_BATCHES, LAB.training.batch_size))


def _rate(job: Callable[[], int]) -> float:
    """Median over repeats, after one to warm up."""
    job()
    rates: list[float] = []
    for _ in range(REPEATS):
        start_s = perf_counter()
        rates.append(job() / (perf_counter() - start_s))
    return median(rates)
