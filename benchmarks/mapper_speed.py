"""How fast is MIND MELD? ``python -m benchmarks.mapper_speed``.

Ratios compare two ways within this run, most of them with ``benchmarks/plain_mind_meld.py``. One
thread, but where more are named and for calibrating many people, which uses two.
"""

from collections.abc import Callable
from dataclasses import replace
from statistics import median
from time import perf_counter

import numpy as np
import torch

from benchmarks.mapper_quality import PEOPLE, label_all
from benchmarks.plain_mind_meld import PlainMindMeld, PlainWindows, calibrate_plain
from benchmarks.rows import Row, at_least, at_most, print_rows
from benchmarks.training_speed import training_rates
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.presets import LAB
from steerlab.learning.series import LabelSeries
from steerlab.learning.streaming import LabelStream
from steerlab.learning.training import torch_threads
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population

BATCH = 512
REPEATS = 7
PLAIN_EPOCHS = 20  # 160 steps at 0.1, assumed enough: twice those that leave 1e-3 at 8 %
MANY = 1000


def run() -> list[Row]:
    """Every figure of speed."""
    rollouts = load_calibration_set()
    series = label_all(sample_population("human", PEOPLE, 100, prefix="seen"), rollouts[:9])
    one_person = [one for one in series if one.person == series[0].person]
    mapper = MindMeldMapper(replace(LAB, training=replace(LAB.training, epochs=1)), seed=0)
    mapper.fit(series)
    rates = training_rates(series, PEOPLE)
    per_epoch = LAB.training.share_per_epoch * sum(one.valid.sum() for one in series)
    rows = [
        at_least(f"training, threads: {threads}", rate, 10_000.0, "windows/s")
        for threads, rate in rates.ours.items()
    ]
    rows += [
        at_least(
            f"training over plain PyTorch, threads: {threads}", rate / rates.best_plain, 2.0, "x"
        )
        for threads, rate in rates.ours.items()
    ]
    with torch_threads(1):
        calibration_s = _seconds(lambda: mapper.calibrate(one_person))
        plain_calibration_s = _plain_calibration_s(one_person)
        return [
            at_least("half windows over a full pass", _half_window_ratio(), 1.4, "x"),
            at_least("one gather over a loop", _gather_ratio(series[:24]), 10.0, "x"),
            *rows,
            at_most(
                "training 34 teachers", LAB.training.epochs * per_epoch / rates.ours[1], 20.0, "s"
            ),
            at_most("calibrating one person", calibration_s, 0.1, "s"),
            at_least(
                "calibration over plain PyTorch", plain_calibration_s / calibration_s, 20.0, "x"
            ),
            at_most(f"calibrating {MANY} people", _many_s(mapper, series), 6.0, "s"),
            at_most("one label, streamed", _label_ms(), 2.0, "ms"),
        ]


def _plain_calibration_s(series: list[LabelSeries]) -> float:
    network, data = PlainMindMeld(PEOPLE), PlainWindows(series)
    start_s = perf_counter()
    calibrate_plain(network, data, epochs=PLAIN_EPOCHS, rate=0.1)
    return perf_counter() - start_s


def _many_s(mapper: MindMeldMapper, series: list[LabelSeries]) -> float:
    """The teachers again and again under other names, nine rollouts each."""
    rounds = -(-MANY // PEOPLE)
    many = [replace(one, person=f"{one.person}/{n}") for n in range(rounds) for one in series]
    many = many[: MANY * len(series) // PEOPLE]
    start_s = perf_counter()
    mapper.calibrate(many)
    return perf_counter() - start_s


def _half_window_ratio() -> float:
    encoder = MindMeld(NetworkConfig(), torch.Generator().manual_seed(0)).encoder
    both, inputs = encoder.bidirectional(), torch.randn(BATCH, 21, 2)

    def half() -> None:
        encoder(inputs).sum().backward()

    def full() -> None:
        states, _ = both(inputs)
        encoder.to_encoding(states[:, 10]).sum().backward()

    return _ratio(full, half)


def _gather_ratio(series: list[LabelSeries]) -> float:
    config = WindowConfig()

    def loop() -> None:
        windows: list[np.ndarray] = []
        for one in series:
            stride = round(one.rate_hz / config.rate_hz)
            reach = stride * config.side
            padded = np.pad(one.label, reach)
            present = np.pad(np.ones(one.steps), reach)
            for step in range(one.steps):
                span = slice(step, step + 2 * reach + 1, stride)
                windows.append(np.stack([padded[span], present[span]], axis=1))
        torch.from_numpy(np.stack(windows).astype(np.float32))

    return _ratio(loop, lambda: make_windows(series, config))


def _label_ms() -> float:
    network = MindMeld(NetworkConfig(), torch.Generator().manual_seed(0)).requires_grad_(False)
    stream = LabelStream(network, WindowConfig(look_ahead_s=0.2), torch.zeros(4), 20.0)

    def push() -> None:
        for _ in range(20):
            stream.push(0.5)

    return 1e3 * _seconds(push) / 20


def _seconds(job: Callable[[], object]) -> float:
    """Median over repeats, after one to warm up."""
    job()
    times: list[float] = []
    for _ in range(REPEATS):
        start_s = perf_counter()
        job()
        times.append(perf_counter() - start_s)
    return median(times)


def _ratio(slow: Callable[[], object], fast: Callable[[], object]) -> float:
    return _seconds(slow) / _seconds(fast)


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
