"""Verbs that learn from labels: ``demo``, ``simulate``, ``fit`` and ``synthetic``."""

from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from steerlab.app.verbs.common import (
    Force,
    Json,
    Out,
    Seed,
    command_line,
    print_json,
    print_summary,
    progress_bar,
    say_where,
)
from steerlab.app.verbs.quick_types import FloatOrNone

Noise = Literal["paper", "low", "human", "high"]
Preset = Literal["lab", "paper"]
Ladder = Literal["full", "quick"]


def demo(
    out: Out = Path("steerlab-demo"), seed: Seed = 0, force: Force = False, json: Json = False
) -> int:
    """A small simulated study from end to end, with a report to open; takes about a minute.

    Example: steerlab demo --out my-demo
    """
    return _simulate(
        out,
        force,
        json,
        teachers=16,
        new_teachers=16,
        noise="human",
        rollouts=8,
        ladder="quick",
        seed=seed,
    )


def simulate(
    out: Out,
    teachers: Annotated[int, tyro.conf.arg(help="Teachers the mapper is trained on.")] = 34,
    new_teachers: Annotated[int, tyro.conf.arg(help="Teachers it has never seen.")] = 34,
    noise: Annotated[Noise, tyro.conf.arg(help="How noisy the teachers are.")] = "human",
    rollouts: Annotated[int, tyro.conf.arg(help="Calibration rollouts, 4 to 12.")] = 12,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    ladder: Annotated[
        Ladder, tyro.conf.arg(help="Rival mappers: all, or those that are fitted in seconds.")
    ] = "full",
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The whole calibration study with scripted teachers, headless, ending in a report.

    Example: steerlab simulate --teachers 34 --new-teachers 34 --noise human --seed 0 --out study
    """
    return _simulate(
        out,
        force,
        json,
        teachers=teachers,
        new_teachers=new_teachers,
        noise=noise,
        rollouts=rollouts,
        preset=preset,
        ladder=ladder,
        seed=seed,
    )


def fit(
    labels: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LABELS")],
    out: Out,
    folds: Annotated[int, tyro.conf.arg(help="Without a split column: how often to hold out.")] = 4,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    ladder: Annotated[
        Ladder, tyro.conf.arg(help="Rival mappers: all, or those that are fitted in seconds.")
    ] = "full",
    limit: Annotated[float, tyro.conf.arg(help="Labels are within plus or minus this.")] = 2.5,
    rate_hz: Annotated[
        FloatOrNone, tyro.conf.arg(help="Steps a second, without a t_s column; 20 by default.")
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Learn from any table of labels, judge the result by cross-validation, and report.

    LABELS is a .csv or .parquet file with the columns person, rollout, step, label and truth;
    docs/fit.md has the format, docs/example-labels.csv an example.

    Example: steerlab fit docs/example-labels.csv --out my-fit
    """
    from steerlab.app.fit import FitConfig
    from steerlab.app.fit import fit as run

    config = FitConfig(
        folds=folds, preset=preset, ladder=ladder, seed=seed, limit=limit, rate_hz=rate_hz
    )
    given = {name: value for name, value in vars(config).items() if value is not None}
    command = command_line("fit", given, out, labels.name)
    with progress_bar() as progress:
        summary = run(labels, config, out, force=force, command=command, progress=progress)
    return print_summary(summary, out, as_json=json)


def synthetic(
    out: Out,
    people: Annotated[int, tyro.conf.arg(help="Demonstrators the mapper is trained on.")] = 34,
    new_people: Annotated[int, tyro.conf.arg(help="Demonstrators it has never seen.")] = 34,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The paper's synthetic experiment, its figure 2, and our numbers beside its 61 % and 55 %.

    Example: steerlab synthetic --seed 0 --out my-synthetic
    """
    from steerlab.analysis.synthetic_report import comparison_lines
    from steerlab.app.synthetic import synthetic as run
    from steerlab.learning.synthetic.experiment import SyntheticConfig

    config = SyntheticConfig(people=people, new_people=new_people, seed=seed)
    given = {"people": people, "new_people": new_people, "seed": seed}
    command = command_line("synthetic", given, out)
    with progress_bar() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    if json:
        print_json(summary.to_dict())
        return 0
    for line in comparison_lines(summary):
        print(line)
    say_where(out)
    return 0


def _simulate(out: Path, force: bool, as_json: bool, **settings: Any) -> int:
    from steerlab.app.population_run import PopulationRunConfig
    from steerlab.app.simulate import simulate as run

    config = PopulationRunConfig(**settings)
    command = command_line("simulate", vars(config), out)
    with progress_bar() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    return print_summary(summary, out, as_json=as_json)
