"""How fast does a policy learn and decide? ``python -m benchmarks.policy_speed``.

One thread; a round of teaching takes ``PolicyTrainingConfig.steps`` gradient steps.
"""

import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
import torch

from benchmarks.rows import Row, at_most, print_rows
from steerlab.learning.policy import (
    IMAGE_SHAPE,
    MOTION_SIZE,
    Observations,
    PolicyConfig,
    PolicyNetwork,
    decide,
)
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows, train_policy
from steerlab.learning.training import torch_threads

ROWS, STEPS, TURNS = 2400, 100, 7
DECISIONS = 300


def run() -> list[Row]:
    """Every figure; ten seconds."""
    rows = _rows()
    with torch_threads(1):
        step_s = _seconds(lambda: _train(rows)) / STEPS
        one_s, ten_s = (
            _seconds(lambda seen=seen: _decide(seen)) / DECISIONS
            for seen in (rows.seen.take(np.arange(count)) for count in (1, 10))
        )
    return [
        at_most("a gradient step of 64", step_s * 1e3, 8.0, "ms"),
        at_most("training between two rounds", step_s * PolicyTrainingConfig().steps, 3.0, "s"),
        at_most("a decision", one_s * 1e3, 1.0, "ms"),
        at_most("ten decisions at once over one", ten_s / one_s, 5.0, "x"),
    ]


def _rows() -> TrainingRows:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (ROWS, *IMAGE_SHAPE), dtype=np.uint8)
    motion = rng.normal(size=(ROWS, MOTION_SIZE)).astype(np.float32)
    return TrainingRows(Observations(image, motion), rng.normal(size=ROWS), np.ones(ROWS))


def _network() -> PolicyNetwork:
    return PolicyNetwork(PolicyConfig(), torch.Generator().manual_seed(0))


def _train(rows: TrainingRows) -> None:
    config = PolicyTrainingConfig(steps=STEPS)
    train_policy(_network(), rows, np.random.default_rng(0), config)


def _decide(seen: Observations) -> None:
    network = _network()
    for _ in range(DECISIONS):
        decide(network, seen)


def _seconds(job: Callable[[], None]) -> float:
    """Median over turns, after one to warm up."""
    found: list[float] = []
    for turn in range(TURNS + 1):
        start_s = perf_counter()
        job()
        if turn:
            found.append(perf_counter() - start_s)
    return median(found)


if __name__ == "__main__":
    sys.exit(print_rows(run()))
