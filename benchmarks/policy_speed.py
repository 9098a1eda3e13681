"""How fast does a policy learn and decide? ``python -m benchmarks.policy_speed``.

The kernels beside the same network in plain PyTorch with its fused Adam, in turns, one thread each;
torch's own layout of images (channels last) counts if it is faster.
"""

import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
import torch

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.learning.policy import (
    IMAGE_SHAPE,
    MOTION_SIZE,
    Observations,
    PolicyConfig,
    PolicyNetwork,
)
from steerlab.learning.policy_inference import Decider
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows, train_policy
from steerlab.learning.training import torch_threads

ROWS, STEPS, TURNS = 2400, 100, 7
DECISIONS = 300


def run() -> list[Row]:
    """Every figure; half a minute."""
    rows = _rows()
    with torch_threads(1):
        ours, plain, last = _in_turns(
            lambda: _train(rows), lambda: _train_plain(rows), lambda: _train_plain(rows, last=True)
        )
        one, ten = (rows.seen.take(np.arange(count)) for count in (1, 10))
        alone, alone_plain = _in_turns(lambda: _decide(one), lambda: _decide_plain(one))
        several, several_plain = _in_turns(lambda: _decide(ten), lambda: _decide_plain(ten))
    step_ms = ours / STEPS * 1e3
    return [
        at_most("a gradient step of 64", step_ms, 4.0, "ms"),
        at_least("a gradient step over plain PyTorch", min(plain, last) / ours, 1.5, "x"),
        at_least("a decision over plain PyTorch", alone_plain / alone, 1.0, "x"),
        at_least("ten decisions over plain PyTorch", several_plain / several, 1.0, "x"),
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


def _train_plain(rows: TrainingRows, last: bool = False) -> None:
    network = _network()
    image = torch.from_numpy(rows.seen.image)
    if last:
        network = network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        image = image.contiguous(memory_format=torch.channels_last)
    motion = torch.from_numpy(rows.seen.motion)
    target, weight = (torch.from_numpy(one).float() for one in (rows.target, rows.weight))
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3, fused=True)
    generator = torch.Generator().manual_seed(0)
    for _ in range(STEPS):
        batch = torch.randint(ROWS, (64,), generator=generator)
        error = network(image[batch], motion[batch]) - target[batch]
        loss = (weight[batch] * error.square()).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()


def _decide(seen: Observations) -> None:
    decider = Decider(_network())
    for _ in range(DECISIONS):
        decider.wheel(seen)


def _decide_plain(seen: Observations) -> None:
    network = _network()
    with torch.inference_mode():
        for _ in range(DECISIONS):
            network(torch.from_numpy(seen.image), torch.from_numpy(seen.motion)).numpy()


def _in_turns(*jobs: Callable[[], None]) -> list[float]:
    """Median seconds of each, after a turn to warm up."""
    seconds: list[list[float]] = [[] for _ in jobs]
    for turn in range(TURNS + 1):
        for job, found in zip(jobs, seconds, strict=True):
            start_s = perf_counter()
            job()
            if turn:
                found.append(perf_counter() - start_s)
    return [median(found) for found in seconds]


if __name__ == "__main__":
    sys.exit(print_rows(run()))
