"""Is the simulation-pretrained mapper fast, and better? ``python -m benchmarks.pretrained [PART]``.

Without a part only speed is measured, on one thread. ``--quality`` adds the study of 34 + 34
scripted people on population seeds 0-4 (tuning used 100-119 only), ``--unusual`` teachers outside
the simulated family.
"""

import sys
from collections.abc import Mapping, Sequence
from itertools import product
from statistics import mean, stdev
from time import perf_counter

import numpy as np
from scipy.stats import rankdata

from benchmarks.mapper_quality import last_second
from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.learning.baselines.ridge import PersonRidgeMapper
from steerlab.learning.empirical_bayes.mapper import EmpiricalBayesMapper
from steerlab.learning.label_quality import mapper_quality
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.probe import style_parameters
from steerlab.learning.series import series_from_table
from steerlab.learning.splits import StudySplit, split_rollouts, split_study
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.records import labelled_table
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.unusual_teachers import QUIRKS, QuirkKind, UnusualTeacher, sample_unusual

PEOPLE = 34
SEEDS = (0, 1, 2, 3, 4)
UNUSUAL_SEEDS: dict[PopulationKind, tuple[int, ...]] = {"human": (0, 1, 2), "low": (0,)}
LEAST: dict[PopulationKind, float] = {"low": 0.78, "human": 0.67}
LEAST_OF_TWO_ROLLOUTS: dict[PopulationKind, float] = {"low": 0.74, "human": 0.63}
LEAST_IMPROVED = 0.98
LEAST_SPEARMAN = {"log_gain": 0.95, "delay_s": 0.9}

Figures = dict[str, float]


def run() -> list[Row]:
    """Speed."""
    split = study_split(sample_people("human", 100))
    mapper = SimPretrainedMapper(fine_tuning=None)
    start_s = perf_counter()
    mapper.calibrate(split.calibrate_new)
    calibration_ms = 1e3 * (perf_counter() - start_s)
    one = split.held_out_new[0]
    mapper.map(one)
    start_s = perf_counter()
    for _ in range(20):
        mapper.map(one)
    rollout_ms = 1e3 * (perf_counter() - start_s) / 20
    return [
        at_most("calibration of 34 people, 9 rollouts each", calibration_ms, 2000.0, "ms"),
        at_most("one label, in a rollout", rollout_ms / one.steps, 0.15, "ms/label"),
    ]


def quality() -> list[Row]:
    """What the mapper must reach, means over ``SEEDS``."""
    rows: list[Row] = []
    for kind, least in LEAST.items():
        studies = [study(kind, seed) for seed in SEEDS]
        print_figures(kind, studies)
        figures = {name: mean(one[name] for one in studies) for name in studies[0]}
        for part in ("seen", "new"):
            ours = f"sim_pretrained {part}"
            rows.append(at_least(f"{kind}: {ours}", figures[ours], least))
            rivals = [f"{name} {part}" for name in ("mind_meld", "person_ridge")]
            margin = min(one[ours] - one[rival] for one in studies for rival in rivals)
            rows.append(at_least(f"{kind}: least lead over both, {part}", margin, 0.0))
        improved = figures["sim_pretrained improved"]
        rows.append(at_least(f"{kind}: people improved", improved, LEAST_IMPROVED))
        two = figures["sim_pretrained two rollouts"]
        rows.append(at_least(f"{kind}: new, two rollouts", two, LEAST_OF_TWO_ROLLOUTS[kind]))
        rows.append(at_least(f"{kind}: last second", figures["sim_pretrained last second"], 0.0))
        if kind == "low":
            for name, limit in LEAST_SPEARMAN.items():
                rows.append(at_least(f"low: |Spearman| {name}", figures[name], limit))
    return rows


def study(kind: PopulationKind, seed: int) -> Figures:
    """Improvement of every mapper on one population."""
    seen, new = sample_people(kind, seed)
    split = study_split((seen, new))
    rng = np.random.default_rng(seed)
    figures: Figures = {}
    for mapper in _mappers(seed):
        mapper.fit(split.train_seen)
        mapper.calibrate(split.calibrate_new)
        qualities = [mapper_quality(mapper, split.held_out_seen, rng)]
        qualities.append(mapper_quality(mapper, split.held_out_new, rng))
        for part, found in zip(("seen", "new"), qualities, strict=True):
            figures[f"{mapper.name} {part}"] = found.improvement
        figures[f"{mapper.name} improved"] = mean(one.people_improved for one in qualities)
        figures[f"{mapper.name} last second"] = last_second(mapper, split.held_out_new)
        if isinstance(mapper, SimPretrainedMapper):
            figures[f"{mapper.name} tuned"] = float(mapper.is_fine_tuned)
            if mapper.name == "sim_pretrained":
                figures |= _spearman(mapper, new)
        names = sorted({one.rollout for one in split.calibrate_new})[:2]
        mapper.calibrate([one for one in split.calibrate_new if one.rollout in names])
        two = mapper_quality(mapper, split.held_out_new, rng)
        figures[f"{mapper.name} two rollouts"] = two.improvement
    return figures


def unusual() -> list[Row]:
    """Improvement outside the simulated family, beside MIND MELD's and the spread of that.

    One population has no spread: there nothing may lie below MIND MELD.
    """
    rows: list[Row] = []
    for quirk, (kind, seeds) in product(QUIRKS, UNUSUAL_SEEDS.items()):
        studies = [unusual_study(quirk, kind, seed) for seed in seeds]
        print_figures(f"{quirk}, {kind}", studies)
        for part in ("seen", "new"):
            rivals = [one[f"mind_meld {part}"] for one in studies]
            lead = min(one[f"sim_pretrained {part}"] - one[f"mind_meld {part}"] for one in studies)
            spread = stdev(rivals) if len(rivals) > 1 else 0.0
            rows.append(at_least(f"{quirk}, {kind}: least lead, {part}", lead, -spread))
    return rows


def unusual_study(quirk: QuirkKind, kind: PopulationKind, seed: int) -> Figures:
    """Improvement of every mapper on one population with a quirk."""
    seen, new = (sample_unusual(quirk, kind, PEOPLE, seed, prefix=part) for part in ("seen", "new"))
    split = study_split((seen, new))
    figures: Figures = {}
    mappers: list[tuple[str, LabelMapper]] = [
        ("frozen", SimPretrainedMapper(fine_tuning=None)),
        *((mapper.name, mapper) for mapper in _mappers(seed)),
    ]
    for name, mapper in mappers:
        mapper.fit(split.train_seen)
        mapper.calibrate(split.calibrate_new)
        for part in ("seen", "new"):
            found = mapper_quality(
                mapper, getattr(split, f"held_out_{part}"), np.random.default_rng(seed)
            )
            figures[f"{name} {part}"] = found.improvement
            figures[f"{name} improved {part}"] = found.people_improved
        if isinstance(mapper, SimPretrainedMapper):
            figures[f"{name} tuned"] = float(mapper.is_fine_tuned)
    return figures


def sample_people(
    kind: PopulationKind, seed: int
) -> tuple[list[ScriptedTeacher], list[ScriptedTeacher]]:
    """Seen and new people of a population."""
    seen, new = (sample_population(kind, PEOPLE, seed, prefix=part) for part in ("seen", "new"))
    return seen, new


def study_split(
    people: tuple[list[ScriptedTeacher], list[ScriptedTeacher]]
    | tuple[list[UnusualTeacher], list[UnusualTeacher]],
) -> StudySplit:
    """Everyone labels the calibration set, by way of the records a study keeps."""
    rollouts = load_calibration_set()
    series = [
        one
        for teacher in (*people[0], *people[1])
        for order, rollout in enumerate(rollouts)
        for one in series_from_table(
            labelled_table(
                rollout,
                teacher.respond(rollout, order=order, attempt=0),
                participant=teacher.name,
            )
        )
    ]
    names = [rollout.name for rollout in rollouts]
    return split_study(series, split_rollouts(names), [teacher.name for teacher in people[1]])


def print_figures(title: str, studies: list[Mapping[str, float]] | list[Figures]) -> None:
    """Mean over populations, and each population's own figure."""
    print(title)
    for name in studies[0]:
        values = [one[name] for one in studies]
        own = " ".join(f"{one:.3f}" for one in values)
        spread = f"±{stdev(values):.3f}" if len(values) > 1 else ""
        print(f"  {name:40} {mean(values):.3f} {spread}  {own}", flush=True)


def _mappers(seed: int) -> list[LabelMapper]:
    return [
        MindMeldMapper(seed=seed),
        PersonRidgeMapper(),
        EmpiricalBayesMapper(),
        SimPretrainedMapper(seed=seed),
        SimPretrainedMapper(context=True, seed=seed),
    ]


def _spearman(mapper: SimPretrainedMapper, people: list[ScriptedTeacher]) -> Figures:
    found = [mapper.teacher_style(one.name) for one in people]
    truth = style_parameters([one.style for one in people])
    return {
        name: abs(rank_correlation(truth[name], [one[name] for one in found]))
        for name in LEAST_SPEARMAN
    }


def rank_correlation(
    first: Sequence[float] | np.ndarray, second: Sequence[float] | np.ndarray
) -> float:
    """Spearman's."""
    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])


if __name__ == "__main__":
    rows = run()
    if "--quality" in sys.argv[1:]:
        rows += quality()
    if "--unusual" in sys.argv[1:]:
        rows += unusual()
    raise SystemExit(print_rows(rows))
