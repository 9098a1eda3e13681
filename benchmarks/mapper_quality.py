"""Does MIND MELD improve labels, and more than simpler ways do? ``--quality`` of the benchmarks.

34 + 34 scripted people on the calibration set, population seeds 0 to 4, none of them used for
tuning (100 to 119 were). A quarter of an hour; ``python -m benchmarks.mapper_quality --full`` also
trains the slow rungs and the causal mappers, which takes an hour.
"""

import sys
from statistics import mean
from time import perf_counter
from typing import Any

import numpy as np

from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.ladder import build_ladder
from steerlab.learning.mapper import LabelMapper, MindMeldMapper, stack_embeddings
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.learning.streaming import StreamingMapper
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.labelling import labelled_table
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher

Row = dict[str, Any]

PEOPLE = 34
SEEDS = (0, 1, 2, 3, 4)
LOOK_AHEADS_S = (0.0, 0.2, 0.5)

# Improvement on seen and new people; a study's own goals.
LEAST: dict[PopulationKind, tuple[float, float]] = {"low": (0.68, 0.64), "human": (0.58, 0.55)}
FIT_LIMIT_S = 20.0


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


def quality(config: MapperConfig = LAB, *, full: bool = False) -> list[Row]:
    """Improvement, style recovery and time, means over the population seeds."""
    rows: list[Row] = []
    for kind, least in LEAST.items():
        runs: list[dict[str, float]] = []
        for seed in SEEDS:
            runs.append(study(kind, seed, config, full=full))
            print(kind, seed, {name: round(value, 3) for name, value in runs[-1].items()})
        figures = {name: mean(one[name] for one in runs) for name in runs[0]}
        print(kind, "mean", {name: round(value, 3) for name, value in figures.items()})
        for part, limit in zip(("seen", "new"), least, strict=True):
            ours, ridge = figures[f"{part} mind_meld"], figures[f"{part} person_ridge"]
            rows.append(_row(f"{kind}: {part} people", ours, limit, ""))
            rows.append(_row(f"{kind}: {part} over person_ridge", ours - ridge, 0.0, ""))
        if kind == "low":
            rows.append(_row("low: gain probe R²", figures["log_gain"], 0.95, ""))
            rows.append(_row("low: delay probe R²", figures["delay_s"], 0.80, ""))
        rows.append(_row(f"{kind}: fit", figures["fit_s"], FIT_LIMIT_S, "s", at_least=False))
    return rows


def study(
    kind: PopulationKind,
    seed: int,
    config: MapperConfig = LAB,
    *,
    people: int = PEOPLE,
    full: bool = False,
) -> dict[str, float]:
    """One calibration study; improvement of each rung on held-out rollouts, and probe R²."""
    rollouts = load_calibration_set()
    seen = sample_population(kind, people, seed, prefix="seen")
    new = sample_population(kind, people, seed, prefix="new")
    split = split_study(
        label_all([*seen, *new], rollouts),
        split_rollouts([rollout.name for rollout in rollouts]),
        [teacher.name for teacher in new],
    )
    mapper = MindMeldMapper(config, seed=seed)
    start_s = perf_counter()
    mapper.fit(split.train_seen)
    fit_s = perf_counter() - start_s
    mapper.calibrate(split.calibrate_new)
    rungs: dict[str, LabelMapper] = build_ladder(
        mapper,
        split,
        seed=seed,
        on_step=lambda what, share: None,
        full=full,
        styles={teacher.name: teacher.style for teacher in (*seen, *new)},
    )
    if full:
        for look_ahead_s in LOOK_AHEADS_S:
            streaming = StreamingMapper(look_ahead_s, config, seed=seed)
            streaming.fit(split.train_seen)
            streaming.calibrate(split.calibrate_new)
            rungs[streaming.name] = streaming
    rng = np.random.default_rng(seed)
    figures: dict[str, float] = {}
    for name, rung in rungs.items():
        figures[f"seen {name}"] = mapper_quality(rung, split.held_out_seen, rng).improvement
        figures[f"new {name}"] = mapper_quality(rung, split.held_out_new, rng).improvement
    embeddings = [stack_embeddings(mapper, [one.name for one in part]) for part in (seen, new)]
    styles = [style_parameters([one.style for one in part]) for part in (seen, new)]
    probe = StyleProbe.fit(embeddings[0], styles[0])
    figures |= probe.probe_r2
    figures |= {f"new {k}": r2 for k, r2 in probe.r2_new(embeddings[1], styles[1]).items()}
    return figures | {"fit_s": fit_s}


def _row(name: str, measured: float, limit: float, unit: str, *, at_least: bool = True) -> Row:
    ok = measured >= limit if at_least else measured <= limit
    return {"name": name, "measured": measured, "limit": limit, "unit": unit, "ok": ok}


if __name__ == "__main__":
    for row in quality(full="--full" in sys.argv[1:]):
        verdict = "pass" if row["ok"] else "FAIL"
        print(f"{row['name']:32} {row['measured']:10.4g} {row['limit']:8g} {row['unit']} {verdict}")
