"""Does MIND MELD improve labels, and more than simpler ways do? ``--quality`` of the benchmarks.

34 + 34 scripted people on the calibration set, population seeds 0 to 4, none of them used for
tuning (100 to 119 were). A quarter of an hour; ``python -m benchmarks.mapper_quality --full`` also
trains the slow baselines, which takes an hour. ``--look-ahead`` measures what mapping while labels
arrive costs, causal and with a fixed look-ahead, on populations 0 and 1 only.
"""

import sys
from collections.abc import Sequence
from statistics import mean, stdev
from time import perf_counter

import numpy as np

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.learning.baselines import fit_baselines, left_out
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.mapper import LabelMapper, MindMeldMapper, stack_embeddings
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import StudySplit, split_rollouts, split_study
from steerlab.learning.streaming import StreamingMapper
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.records import labelled_table
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher

PEOPLE = 34
SEEDS = (0, 1, 2, 3, 4)
LOOK_AHEAD_SEEDS = (0, 1)
LOOK_AHEADS_S = (0.0, 0.1, 0.2, 0.5, 1.0)  # the last is the whole window: MIND MELD itself

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
            rows.append(at_least(f"{kind}: {part} people", ours, limit))
            rows.append(at_least(f"{kind}: {part} over person_ridge", ours - ridge, 0.0))
        if kind == "low":
            rows.append(at_least("low: gain probe R²", figures["log_gain"], 0.95))
            rows.append(at_least("low: delay probe R²", figures["delay_s"], 0.80))
        rows.append(at_most(f"{kind}: fit", figures["fit_s"], FIT_LIMIT_S, "s"))
    return rows


def study(
    kind: PopulationKind,
    seed: int,
    config: MapperConfig = LAB,
    *,
    people: int = PEOPLE,
    full: bool = False,
) -> dict[str, float]:
    """One calibration study; improvement of each baseline on held-out rollouts, and probe R²."""
    seen = sample_population(kind, people, seed, prefix="seen")
    new = sample_population(kind, people, seed, prefix="new")
    split = _split(seen, new)
    mapper = MindMeldMapper(config, seed=seed)
    start_s = perf_counter()
    mapper.fit(split.train_seen)
    fit_s = perf_counter() - start_s
    mapper.calibrate(split.calibrate_new)
    baselines: dict[str, LabelMapper] = fit_baselines(
        mapper,
        split,
        seed=seed,
        on_step=lambda share: None,
        without=left_out([split], config, full=full, styles_known=True),
        styles={teacher.name: teacher.style for teacher in (*seen, *new)},
    )
    rng = np.random.default_rng(seed)
    figures: dict[str, float] = {}
    for name, baseline in baselines.items():
        figures[f"seen {name}"] = mapper_quality(baseline, split.held_out_seen, rng).improvement
        figures[f"new {name}"] = mapper_quality(baseline, split.held_out_new, rng).improvement
    embeddings = [stack_embeddings(mapper, [one.name for one in part]) for part in (seen, new)]
    styles = [style_parameters([one.style for one in part]) for part in (seen, new)]
    probe = StyleProbe.fit(embeddings[0], styles[0])
    figures |= probe.probe_r2
    figures |= {f"new {k}": r2 for k, r2 in probe.r2_new(embeddings[1], styles[1]).items()}
    return figures | {"fit_s": fit_s}


def look_ahead(config: MapperConfig = LAB) -> None:
    """Print what each look-ahead gives: improvement, mean and spread over populations."""
    for kind in LEAST:
        for look_ahead_s in LOOK_AHEADS_S:
            found: dict[str, list[float]] = {"seen": [], "new": [], "last second, new": []}
            for seed in LOOK_AHEAD_SEEDS:
                seen, new = (
                    sample_population(kind, PEOPLE, seed, prefix=part) for part in ("seen", "new")
                )
                split, rng = _split(seen, new), np.random.default_rng(seed)
                mapper = StreamingMapper(look_ahead_s, config, seed=seed)
                mapper.fit(split.train_seen)
                mapper.calibrate(split.calibrate_new)
                for part, series in (("seen", split.held_out_seen), ("new", split.held_out_new)):
                    found[part].append(mapper_quality(mapper, series, rng).improvement)
                found["last second, new"].append(last_second(mapper, split.held_out_new))
            figures = ", ".join(
                f"{part} {mean(values):.3f} ±{stdev(values):.3f}" for part, values in found.items()
            )
            print(f"{kind}, {look_ahead_s:g} s ahead: {figures}", flush=True)


def last_second(mapper: LabelMapper, series: Sequence[LabelSeries]) -> float:
    """Improvement on the last second of rollouts, where nothing lies ahead."""
    before = after = 0.0
    for one in series:
        last = round(one.rate_hz)
        before += float(np.abs(one.label - one.truth)[-last:].sum())
        after += float(np.abs(mapper.map(one) - one.truth)[-last:].sum())
    return 1.0 - after / before


def _split(seen: list[ScriptedTeacher], new: list[ScriptedTeacher]) -> StudySplit:
    rollouts = load_calibration_set()
    return split_study(
        label_all([*seen, *new], rollouts),
        split_rollouts([rollout.name for rollout in rollouts]),
        [teacher.name for teacher in new],
    )


if __name__ == "__main__":
    raise SystemExit(print_rows(quality(full="--full" in sys.argv[1:])))
