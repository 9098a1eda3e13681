"""Is MIND MELD fast and does it improve labels? ``python benchmarks/mapper.py [--quality]``.

Speed is measured on one thread; ratios compare two ways within this run. ``--quality`` adds the
study of 34 + 34 scripted people on the calibration set, population seeds 0, 1 and 2, none of them
used for tuning (100-104 were), about three minutes.
"""

import sys
from collections.abc import Callable
from statistics import mean, median
from time import perf_counter
from typing import Any

import numpy as np
import torch

from steerlab.learning.baselines import MeanEmbeddingMapper, PersonGainMapper
from steerlab.learning.calibration import calibrate
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.mapper import MindMeldMapper, stack_embeddings
from steerlab.learning.mind_meld import MindMeld, NetworkConfig
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.learning.training import mind_meld_loss, torch_threads
from steerlab.learning.windows import WindowConfig, make_windows
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.labelling import labelled_table
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher

PEOPLE = 34
SEEDS = (0, 1, 2)
BATCH = 512
REPEATS = 7

LEAST: dict[PopulationKind, float] = {"low": 0.60, "human": 0.48}
FIT_AND_CALIBRATE_LIMIT_S = 25.0


def label_all(teachers: list[ScriptedTeacher], rollouts: tuple[Rollout, ...]) -> list[LabelSeries]:
    """What the teachers say of every rollout, by way of the records a study keeps."""
    return [
        one
        for teacher in teachers
        for order, rollout in enumerate(rollouts)
        for one in series_from_table(
            labelled_table(
                rollout,
                teacher.respond(rollout, order=order, attempt=0),
                participant=teacher.name,
            )
        )
    ]


def run() -> list[dict[str, Any]]:
    """Speed."""
    rollouts = load_calibration_set()
    series = label_all(sample_population("human", PEOPLE, 100, prefix="seen"), rollouts[:9])
    with torch_threads(1):
        return [
            _row("half windows over a full pass", _half_window_ratio(), 1.4, "x", at_least=True),
            _row("one gather over a loop", _gather_ratio(series[:24]), 10.0, "x", at_least=True),
            _row("training", _training_rate(), 10_000.0, "windows/s", at_least=True),
            _row("calibration", _calibration_ms(series), 150.0, "ms/person"),
            _row("one label", _label_ms(), 2.0, "ms"),
        ]


def quality(config: MapperConfig = LAB) -> list[dict[str, Any]]:
    """Improvement, style recovery and time, means over the population seeds."""
    rows: list[dict[str, Any]] = []
    for kind, least in LEAST.items():
        runs = [study(kind, seed, config) for seed in SEEDS]
        figures = {name: mean(one[name] for one in runs) for name in runs[0]}
        print(kind, {name: [round(one[name], 3) for one in runs] for name in figures})
        for part in ("seen", "new"):
            rows.append(_row(f"{kind}: {part} people", figures[part], least, "", at_least=True))
        if kind == "low":
            rows.append(_row("low: gain probe R²", figures["log_gain"], 0.95, "", at_least=True))
            rows.append(_row("low: delay probe R²", figures["delay_s"], 0.80, "", at_least=True))
        seconds = figures["fit_and_calibrate_s"]
        rows.append(_row(f"{kind}: fit and calibrate", seconds, FIT_AND_CALIBRATE_LIMIT_S, "s"))
    return rows


def study(
    kind: PopulationKind, seed: int, config: MapperConfig = LAB, people: int = PEOPLE
) -> dict[str, float]:
    """One calibration study; improvement on held-out rollouts and probe R²."""
    rollouts = load_calibration_set()
    seen = sample_population(kind, people, seed, prefix="seen")
    new = sample_population(kind, people, seed, prefix="new")
    split = split_study(
        label_all([*seen, *new], rollouts),
        split_rollouts([rollout.name for rollout in rollouts]),
        [teacher.name for teacher in new],
    )
    mapper, gain = MindMeldMapper(config, seed=seed), PersonGainMapper()
    start_s = perf_counter()
    mapper.fit(split.train_seen)
    mapper.calibrate(split.calibrate_new)
    seconds = perf_counter() - start_s
    gain.fit(split.train_seen)
    gain.calibrate(split.calibrate_new)
    rng = np.random.default_rng(seed)
    figures: dict[str, float] = {}
    for suffix, rung in (("", mapper), (" gain", gain), (" mean w", MeanEmbeddingMapper(mapper))):
        figures[f"seen{suffix}"] = mapper_quality(rung, split.held_out_seen, rng).improvement
        figures[f"new{suffix}"] = mapper_quality(rung, split.held_out_new, rng).improvement
    embeddings = [stack_embeddings(mapper, [one.name for one in part]) for part in (seen, new)]
    styles = [style_parameters([one.style for one in part]) for part in (seen, new)]
    probe = StyleProbe.fit(embeddings[0], styles[0])
    figures |= probe.probe_r2
    figures |= {f"new {k}": r2 for k, r2 in probe.r2_new(embeddings[1], styles[1]).items()}
    return figures | {"fit_and_calibrate_s": seconds}


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


def _training_rate() -> float:
    generator = torch.Generator().manual_seed(0)
    network = MindMeld(NetworkConfig(), generator)
    inputs, difference = torch.randn(BATCH, 21, 2), torch.randn(BATCH)
    embedding = torch.randn(BATCH, 4, requires_grad=True)

    def step() -> None:
        mind_meld_loss(network, inputs, difference, embedding, 0.1, generator).total.backward()

    return BATCH / _seconds(step)


def _calibration_ms(series: list[LabelSeries]) -> float:
    network = MindMeld(NetworkConfig(), torch.Generator().manual_seed(0)).requires_grad_(False)
    windows = make_windows(series, WindowConfig())
    start_s = perf_counter()
    calibrate(network, windows, torch.zeros(4), LAB.training.embedding_loss_weight)
    return 1e3 * (perf_counter() - start_s) / len(windows.people)


def _label_ms() -> float:
    network = MindMeld(NetworkConfig(), torch.Generator().manual_seed(0)).requires_grad_(False)
    inputs, embedding = torch.randn(1, 21, 2), torch.zeros(1, 4)
    return 1e3 * _seconds(lambda: network.difference(network.encoder(inputs), embedding))


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


def _row(
    name: str, measured: float, limit: float, unit: str, *, at_least: bool = False
) -> dict[str, Any]:
    ok = measured >= limit if at_least else measured <= limit
    return {"name": name, "measured": measured, "limit": limit, "unit": unit, "ok": ok}


if __name__ == "__main__":
    rows = run() + (quality() if "--quality" in sys.argv[1:] else [])
    for row in rows:
        verdict = "pass" if row["ok"] else "FAIL"
        print(
            f"{row['name']:32} {row['measured']:10.4g} {row['limit']:8g} {row['unit']:10} {verdict}"
        )
    raise SystemExit(0 if all(row["ok"] for row in rows) else 1)
